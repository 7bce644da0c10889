"""The expert as teacher: labels for every row of an environment, whatever flies it."""

from __future__ import annotations

import numpy as np

from kernel.jit import njit, prange
from policies.environment import episode_row
from policies.environment.config import TICK
from policies.environment.env import Env, fill_future
from policies.environment.observe import true_gain
from policies.planner.policy import planner_params
from policies.prediction.future import HORIZON, STEP
from policies.task.observation import action_from_command
from policies.teachers import expert_row
from policies.teachers.expert import expert_due, expert_step
from policies.teachers.params import AT, ExpertParams

_TICKS = round(STEP / TICK)


@njit
def teach_row(rows, i, shared, plan, future, expert, planner, command, out):
    """The expert's action for row i now, into `out` (4,) in [-1, 1]. Returns the seconds to its contact.

    `plan` (expert_row.DIM,); `future` (HORIZON, 8) and `command` (4,) are scratch.
    """
    now = rows.state[i, episode_row.STEP] * TICK
    if rows.done[i] == 1:
        plan[:] = 0.0
    board, gain = rows.track[i, int(rows.state[i, episode_row.STEP])], true_gain(rows, i, shared)
    if expert_due(plan, now):
        fill_future(rows, i, round(expert[AT.predicted] / TICK), _TICKS, future)
    expert_step(rows, i, plan, board, future, STEP, gain, expert, planner, command)
    action_from_command(command, shared.limits, out)
    return plan[expert_row.CONTACT] - now if plan[expert_row.READY] > 0.0 else np.inf


@njit(parallel=True)
def teach_rows(rows, shared, plans, futures, expert, planner, commands, remaining, out):
    """`teach_row` for every row."""
    for i in prange(rows.done.shape[0]):
        remaining[i] = teach_row(rows, np.int64(i), shared, plans[i], futures[i], expert, planner, commands[i], out[i])


class Teacher:
    """The expert's labels for every row; it plans on privileged information, the board's future and the true gain.

    Call `act` once a step, and `reset` after `Env.reset`.
    """

    def __init__(self, env: Env, params: ExpertParams | None = None) -> None:
        n = env.config.count
        self._env, self._expert = env, (params or ExpertParams.of(env.airframe)).row()
        self._planner = planner_params(env.airframe).row()
        self._plans, self._futures = np.zeros((n, expert_row.DIM)), np.zeros((n, HORIZON, 8))
        self._commands = np.zeros((n, 4))
        self.actions, self.remaining = np.zeros((n, 4)), np.full(n, np.inf)

    def reset(self) -> None:
        """Clear all plans; call it after `Env.reset`."""
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
        parts = (self._plans, self._futures, self._expert, self._planner, self._commands)
        teach_rows(rows, shared, *parts, self.remaining, self.actions)
        return self.actions
