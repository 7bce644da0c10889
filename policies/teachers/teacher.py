"""The expert as teacher: labels for every row of an environment, whoever is flying."""

from __future__ import annotations

import numpy as np

from kernel.jit import njit, prange
from policies.environment import episode_row
from policies.environment.config import TICK
from policies.environment.env import Env, fill_future
from policies.environment.observe import true_gain
from policies.estimation.board_ekf import belief_covariance
from policies.estimation.ctrv import ACCEL_TAU, N
from policies.estimation.thrust_drag import G_GAIN
from policies.planner.params import PlannerParams
from policies.prediction.future import CTRV_ACCELERATION, HORIZON, STEP, predict_future
from policies.task.observation import action_from_command
from policies.teachers.expert import expert_due, expert_step
from policies.teachers.params import EXPERT_DIM, X_CONTACT, X_READY, ExpertParams

_TICKS = round(STEP / TICK)
_WORK = 12 + N * N


@njit
def teach_row(rows, i, shared, plan, future, expert, planner, work, sighted, out):
    """The expert's action for row i now, into `out` (4,) in [-1, 1]. Returns the seconds to its contact.

    `sighted` False: it plans on the belief and on the estimated thrust gain, as something that flies would have to.
    `work` (_WORK,) is scratch.
    """
    now = rows.state[i, episode_row.STEP] * TICK
    if rows.done[i] == 1:
        plan[:] = 0.0
    command, board = work[0:4], work[4:12]
    due = expert_due(plan, now)
    if sighted:
        board[:] = rows.track[i, int(rows.state[i, episode_row.STEP])]
        gain = true_gain(rows, i, shared)
        if due:
            fill_future(rows, i, _TICKS, future)
    else:
        belief_covariance(rows.belief[i], now, shared.belief, board, work[12:_WORK])
        gain = rows.gain[i, G_GAIN]
        if due:
            predict_future(board, CTRV_ACCELERATION, shared.belief[ACCEL_TAU], STEP, future)
    expert_step(rows, i, plan, board, future, STEP, gain, expert, planner, command)
    action_from_command(command, shared.limits, out)
    return plan[X_CONTACT] - now if plan[X_READY] > 0.0 else np.inf


@njit(parallel=True)
def teach_rows(rows, shared, plans, futures, expert, planner, works, sighted, remaining, out):
    """`teach_row` for every row."""
    for i in prange(rows.done.shape[0]):
        remaining[i] = teach_row(rows, i, shared, plans[i], futures[i], expert, planner, works[i], sighted, out[i])


class Teacher:
    """Labels for every row of an environment; call `act` once a step, and `reset` after `Env.reset`.

    `sighted` False makes it a policy: the same expert on belief and prediction instead of on the truth.
    """

    def __init__(self, env: Env, params: ExpertParams | None = None, sighted: bool = True) -> None:
        n = env.config.count
        self._env, self._expert, self._planner = env, (params or ExpertParams()).row(), PlannerParams().row()
        self._plans, self._futures = np.zeros((n, EXPERT_DIM)), np.zeros((n, HORIZON, 8))
        self._work, self._sighted = np.zeros((n, _WORK)), sighted
        self.actions, self.remaining = np.zeros((n, 4)), np.full(n, np.inf)

    def reset(self) -> None:
        """Forget all plans, as after `Env.reset`."""
        self._plans[:] = 0.0

    def state(self) -> dict:
        """Plans and futures, for a checkpoint."""
        return {"plans": self._plans.copy(), "futures": self._futures.copy()}

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        self._plans[:], self._futures[:] = state["plans"], state["futures"]

    def act(self) -> np.ndarray:
        """The actions ((N, 4) in [-1, 1], overwritten by the next call); `remaining` gets the s to each contact."""
        rows, shared = self._env.rows, self._env.shared
        parts = (self._plans, self._futures, self._expert, self._planner, self._work, self._sighted)
        teach_rows(rows, shared, *parts, self.remaining, self.actions)
        return self.actions
