"""The planner fed by the learned motion predictor, as a flying policy."""

from __future__ import annotations

import math

import numpy as np

from policies.fly import BoardView, Command, VehicleView
from policies.planner import (
    E_AGE,
    E_SIGMA,
    E_SPEED_SIGMA,
    E_STREAK,
    E_VALID,
    HOLD,
    PHASES,
    S_GAIN,
)
from policies.planner_params import PlannerParams
from policies.planner_policy import PlannerPolicy
from policies.prediction import STEP
from policies.predictor import HISTORY_DIM, SCRATCH_DIM, load_predictor, predictor_clear
from policies.predictor_planner import planner_on_learned
from policies.thrust_gain import G_GAIN
from vehicle.airframe import Airframe


class LearnedPlannerPolicy(PlannerPolicy):
    """`PlannerPolicy` whose future comes from the network; without enough history it is the analytic one."""

    def __init__(self, airframe: Airframe, params: PlannerParams | None = None, net: np.ndarray | None = None) -> None:
        """`net`: row of `predictor.load_predictor`, by default the committed one. Raises what that raises."""
        self._net = load_predictor() if net is None else net
        self._memory, self._scratch = np.zeros(HISTORY_DIM), np.zeros(SCRATCH_DIM, dtype=np.float32)
        super().__init__(airframe, params)

    def reset(self, now_ns: int) -> None:
        """Start anew; `now_ns` becomes second 0."""
        super().reset(now_ns)
        predictor_clear(self._memory)

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command:
        """One control tick."""
        t = (now_ns - self._origin_ns) * 1e-9
        variance, estimate = board.variance, self._estimate
        estimate[E_VALID] = 1.0 if board.valid else 0.0
        estimate[E_SIGMA] = math.sqrt(max(0.0, 0.5 * (variance[0] + variance[1])))
        estimate[E_SPEED_SIGMA] = math.sqrt(max(0.0, variance[4]))
        estimate[E_AGE] = (now_ns - board.last_exposure_ns) * 1e-9
        estimate[E_STREAK] = board.streak
        self._x[:3] = board.position
        self._x[3:] = board.heading, board.speed, board.turn_rate, board.inclination, board.acceleration
        velocity = np.array(vehicle.velocity)
        position = np.array(vehicle.position) + (now_ns - vehicle.stamp_ns) * 1e-9 * velocity
        phase = planner_on_learned(
            self._state,
            self._memory,
            t,
            position,
            velocity,
            np.array(vehicle.orientation),
            self._x,
            estimate,
            self._future,
            STEP,
            self._params,
            self._net,
            self._scratch,
            self._out,
        )
        self._engaged = self._engaged or phase != HOLD
        p, q, r, thrust = (float(value) for value in self._out)
        return Command(self._engaged, (p, q, r), thrust, PHASES[int(phase)], float(self._state[S_GAIN + G_GAIN]))
