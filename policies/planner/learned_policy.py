"""The planner fed by the learned motion predictor, as a flying policy."""

from __future__ import annotations

import numpy as np

from policies.planner.learned_planner import MEMORY_DIM, planner_on_learned
from policies.planner.policy import PlannerPolicy
from policies.prediction import scratch_row
from policies.prediction.future import STEP
from policies.prediction.learned import load_predictor
from policies.task.interface import BoardView, Command, VehicleView
from policies.task.unusable import no_command, why_unusable
from vehicle.quadrotor.airframe import Airframe


class LearnedPlannerPolicy(PlannerPolicy):
    """`PlannerPolicy` whose future comes from the network; without enough history it is the analytic one."""

    def __init__(self, airframe: Airframe, net: np.ndarray | None = None, by_state: bool = False) -> None:
        """`net`: row of `load_predictor`, by default of the committed network. Raises what `load_predictor` raises."""
        self._net = load_predictor() if net is None else net
        self._memory, self._scratch = np.zeros(MEMORY_DIM), np.zeros(scratch_row.DIM, dtype=np.float32)
        super().__init__(airframe, by_state)

    def reset(self, now_ns: int) -> None:
        """Start anew; `now_ns` becomes second 0."""
        super().reset(now_ns)
        self._memory[:] = 0.0

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command:
        """One control tick, as of `PlannerPolicy`."""
        if why := why_unusable(now_ns, vehicle, board):
            return no_command(self._engaged, why)
        t, position, velocity, orientation = self._look(now_ns, vehicle, board)
        phase = planner_on_learned(
            self._state, self._memory, t, position, velocity, orientation, self._x, self._estimate, self._future, STEP,
            self._params, self._net, self._scratch, self._out,
        )  # fmt: skip
        return self._command(phase)
