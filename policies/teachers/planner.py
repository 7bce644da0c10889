"""The planners in the training environment: flown on the rows that a network's observation is built from.

As contenders they get what a flight would give them: the belief filter (or, in the state stage, the true board now and
its past), the vehicle's own estimate with odometry noise, and the thrust they asked for.
As a teacher the planner imparts to watch first, which an expert who needs no camera never shows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from kernel.jit import njit, prange
from policies.environment import config_row, episode_row
from policies.environment.config import TICK
from policies.environment.env import Env, fill_future
from policies.environment.observe import shown_odometry
from policies.estimation.ctrv import N
from policies.estimation.thrust_drag import GAIN_DIM
from policies.planner.learned_planner import MEMORY_DIM, planner_on_learned
from policies.planner.params import STEEP
from policies.planner.planner import (
    COMMIT,
    E_SURPRISE,
    E_VALID,
    ESTIMATE_DIM,
    PLANNER_DIM,
    S_ASKED,
    S_CONTACT,
    S_GAIN,
    S_PHASE,
    TERMINAL,
    certain,
    estimate_from_belief,
    planner_due,
    planner_on_estimate,
    planner_reset,
    planner_step,
)
from policies.planner.policy import planner_params
from policies.planner.runup import runs_up
from policies.prediction.future import HORIZON, STEP
from policies.prediction.learned import SCRATCH_DIM, load_predictor
from policies.task.observation import action_from_command

_TICKS = round(STEP / TICK)
_LAG = 5  # control steps over which the true board's acceleration is taken
ANALYTIC, LEARNED, FORESEEN = 0, 1, 2  # where the future comes from
FORESIGHT, BELIEF = "foresight", "belief"  # what a planner that teaches knows

# A student follows less exactly than it is shown: a teacher who waits for an exact standoff would let it wait for ever,
# one who takes the board to the picture's edge would let it lose the board.
_READILY = {"commit_cost": 8.0, "run_away": 1.2, "run_turn": 1.0, "camera_half_fov": math.radians(19.0)}
# Its approach is never as cheap as the planner's own, and it turns up late: it leans 0.05 rad more than it is shown to,
# over steep boards whose speed swings 0.1.
_BOLDLY: dict[str, Any] = {"commit_cost": 4.0, "lean": 0.0, "steep": {**STEEP, "lean": -0.025}}

# Slices of a work row.
_BOARD, _COVARIANCE = 0, 8
_ESTIMATE = _COVARIANCE + N * N
_COMMAND = _ESTIMATE + ESTIMATE_DIM
_WORK_DIM = _COMMAND + 4


@njit
def _board_now(rows, i, shared, now, foreseen, x, covariance, estimate):
    """What is known of the board: state and acceleration into `x` (8,), how well into `estimate`."""
    if shared.config[config_row.VISION] > 0.0:
        estimate_from_belief(rows.belief[i], now, shared.belief, x, covariance, estimate)
        if not foreseen:
            return
        estimate[E_VALID], estimate[E_SURPRISE] = 1.0, 0.0
    else:
        certain(estimate)
    step = int(rows.state[i, episode_row.STEP])
    x[:] = rows.track[i, step]
    lag = min(_LAG, step)
    x[7] = (rows.track[i, step, 4] - rows.track[i, step - lag, 4]) / (lag * TICK) if lag > 0 else 0.0


@njit
def plan_row(rows, i, shared, fresh, source, state, memory, work, future, scratch, params, net, out):
    """The planner's action for row i now, into `out` (4,) in [-1, 1]; `fresh`: an episode begins.

    `state` (PLANNER_DIM,), `memory` (predictor_planner.MEMORY_DIM,) are the row's planner; `work`, `future`
    ((HORIZON, 8)), `scratch` are scratch. `source`: where the future comes from.
    """
    now = rows.state[i, episode_row.STEP] * TICK
    if fresh:
        planner_reset(state, now, params)
        memory[:] = 0.0
        state[S_GAIN : S_GAIN + GAIN_DIM] = rows.gain[i]  # the hover before the episode has shown it
    state[S_ASKED : S_ASKED + 4] = rows.state[
        i, episode_row.COMMAND : episode_row.COMMAND + 4
    ]  # what was flown shows what thrust gives
    x, estimate = work[_BOARD : _BOARD + 8], work[_ESTIMATE : _ESTIMATE + ESTIMATE_DIM]
    command = work[_COMMAND : _COMMAND + 4]
    _board_now(rows, i, shared, now, source == FORESEEN, x, work[_COVARIANCE:_ESTIMATE], estimate)
    p, v, q = shown_odometry(rows.scratch[i])
    if source == FORESEEN:
        if planner_due(state, now):
            fill_future(rows, i, _TICKS, future)
        planner_step(state, now, p, v, q, x, estimate, future, STEP, params, command)
    elif source == LEARNED:
        planner_on_learned(state, memory, now, p, v, q, x, estimate, future, STEP, params, net, scratch, command)
    else:
        planner_on_estimate(state, now, p, v, q, x, estimate, future, STEP, params, command)
    action_from_command(command, shared.limits, out)


@njit(parallel=True)
def plan_rows(rows, shared, fresh, source, states, memories, works, futures, scratches, params, net, out):
    """`plan_row` for every row."""
    for i in prange(rows.done.shape[0]):
        plan_row(
            rows, i, shared, fresh[i] != 0, source, states[i], memories[i], works[i], futures[i], scratches[i],
            params, net, out[i],
        )  # fmt: skip


class PlannerInEnv:
    """A planner as an `evaluate.Policy`; call it once a step. A new environment starts it anew."""

    def __init__(self, source: int = LEARNED, **changes: Any) -> None:
        """`source` of the future; `changes` of PlannerParams. Raises what `predictor.load_predictor` raises."""
        self._source, self._changes = source, changes
        self._net = load_predictor() if source == LEARNED else np.zeros(0, dtype=np.float32)
        self._env: Env | None = None

    def __call__(self, env: Env) -> np.ndarray:
        """Actions ((N, 4) in [-1, 1], overwritten by the next call)."""
        if env is not self._env:
            self.begin(env)
        fresh, self.first = np.ones_like(env.rows.done) if self.first else env.rows.done, False
        plan_rows(
            env.rows, env.shared, fresh, self._source, self.states, self.memories, self._works, self._futures,
            self._scratches, self._params, self._net, self._out,
        )  # fmt: skip
        return self._out

    def runs_up(self) -> np.ndarray:
        """(N,) bool: which boards, as last seen, take a run-up."""
        return np.array([runs_up(work[_BOARD : _BOARD + 8], self._params) for work in self._works])

    def begin(self, env: Env) -> None:
        """Make a planner for every row, whose first call will start it."""
        self.first = True
        n = env.config.count
        self._env, self._params = env, replace(planner_params(env.airframe), **self._changes).row()
        self.states, self.memories = np.zeros((n, PLANNER_DIM)), np.zeros((n, MEMORY_DIM))
        self._works, self._futures = np.zeros((n, _WORK_DIM)), np.zeros((n, HORIZON, 8))
        self._scratches, self._out = np.zeros((n, SCRATCH_DIM), dtype=np.float32), np.zeros((n, 4))


class PlannerTeacher:
    """The planner's actions as labels for every row, whoever is flying; see `env_teacher.Teacher`.

    FORESIGHT: it knows where the board is and will be, but commits only when what the camera has shown would do.
    BELIEF: it knows what the student is told and no more, so that nothing in a label has to be guessed.
    """

    def __init__(self, env: Env, knows: str = FORESIGHT, run_up: Mapping[str, float] | None = None) -> None:
        """`knows`: FORESIGHT or BELIEF; `run_up`: changes of what BELIEF does on steep boards, see PlannerParams."""
        self._env = env
        boldly = {**_BOLDLY, "steep": {**_BOLDLY["steep"], **(run_up or {})}}
        source, changes = (FORESEEN, _READILY) if knows == FORESIGHT else (LEARNED, boldly)
        self._planner = PlannerInEnv(source, **changes)
        self._planner.begin(env)
        self.remaining = np.full(env.config.count, np.inf)

    def state(self) -> dict:
        """The planners, for a checkpoint."""
        return {"states": self._planner.states.copy(), "memories": self._planner.memories.copy()}

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        self._planner.states[:], self._planner.first = state["states"], False
        self._planner.memories[:] = state["memories"]

    def runs_up(self) -> np.ndarray:
        """(N,) bool: which boards, as last seen by `act`, take a run-up."""
        return self._planner.runs_up()

    def act(self) -> np.ndarray:
        """The actions ((N, 4) in [-1, 1], overwritten by the next call); `remaining` gets the s to each contact."""
        states = self._planner.states
        actions = self._planner(self._env)
        bound = np.isin(states[:, S_PHASE], (COMMIT, TERMINAL))
        left = states[:, S_CONTACT] - self._env.rows.state[:, episode_row.STEP] * TICK
        self.remaining[:] = np.where(bound, left, np.inf)
        return actions
