"""The planners in the training environment, on the rows that a network's observation is built from.

`PlannerInEnv` flies them as contenders: with the belief filter (in the state stage: the true board now and its past),
the vehicle's own estimate with odometry noise, and the thrust that was commanded. `PlannerTeacher` labels with them the
states that a student visits.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from groundcar.motion import board_row
from kernel.jit import njit, prange
from policies.environment import config_row, episode_row
from policies.environment.config import TICK
from policies.environment.env import Env
from policies.environment.observe import shown_odometry
from policies.estimation import belief_state, thrust_row
from policies.planner import estimate_row, phases, state_row
from policies.planner.estimate import certain, estimate_from_belief
from policies.planner.learned_planner import MEMORY_DIM, planner_on_learned
from policies.planner.planner import planner_on_estimate, planner_reset
from policies.planner.policy import planner_params
from policies.prediction import scratch_row
from policies.prediction.future import HORIZON, STEP
from policies.prediction.learned import load_predictor
from policies.task.observation import action_from_command

_LAG = 5  # control steps over which the true board's acceleration is taken
ANALYTIC, LEARNED = 0, 1  # which predictor is used

# A student never reaches plans as cheap as the planner's own, so the teacher commits at a higher cost. A student also
# pitches up late: it leans 0.05 rad more than its labels, 0.1 rad over steep boards with an oscillating speed.
_TEACHING = {"commit.cost": 4.0, "contact.lean": 0.0}
_TEACHING_STEEP = {"contact.lean": -0.025}

# Slices of a work row.
_BOARD, _COVARIANCE = 0, 8
_ESTIMATE = _COVARIANCE + belief_state.DIM * belief_state.DIM
_COMMAND = _ESTIMATE + estimate_row.DIM
_WORK_DIM = _COMMAND + 4


@njit
def _board_now(rows, i, shared, now, x, covariance, estimate):
    """The board as the policy knows it: state into `x` (8,) (belief_state), its uncertainty into `estimate`."""
    if shared.config[config_row.VISION] > 0.0:
        estimate_from_belief(rows.belief[i], now, shared.belief, x, covariance, estimate)
        return
    certain(estimate)
    step = int(rows.state[i, episode_row.STEP])
    x[:] = rows.track[i, step]
    lag = min(_LAG, step)
    x[belief_state.ACCELERATION] = (
        (rows.track[i, step, board_row.SPEED] - rows.track[i, step - lag, board_row.SPEED]) / (lag * TICK)
        if lag > 0
        else 0.0
    )


@njit
def plan_row(rows, i, shared, fresh, source, state, memory, work, future, scratch, params, net, out):
    """The planner's action for row i now, into `out` (4,) in [-1, 1]; `fresh`: an episode begins.

    `state` (state_row.DIM,), `memory` (learned_planner.MEMORY_DIM,) are the row's planner; `work`, `future`
    ((HORIZON, 8)), `scratch` are scratch. `source`: the predictor, ANALYTIC or LEARNED.
    """
    now = rows.state[i, episode_row.STEP] * TICK
    if fresh:
        planner_reset(state, now)
        memory[:] = 0.0
        state[state_row.GAIN : state_row.GAIN + thrust_row.DIM] = rows.gain[i]  # estimated in the hover before
    # The thrust gain is what the vehicle gives for the command that it flew, whatever policy asked for it.
    flown = episode_row.COMMAND
    state[state_row.ASKED : state_row.ASKED + 4] = rows.state[i, flown : flown + 4]
    x, estimate = work[_BOARD : _BOARD + 8], work[_ESTIMATE : _ESTIMATE + estimate_row.DIM]
    command = work[_COMMAND : _COMMAND + 4]
    _board_now(rows, i, shared, now, x, work[_COVARIANCE:_ESTIMATE], estimate)
    p, v, q = shown_odometry(rows.scratch[i])
    if source == LEARNED:
        planner_on_learned(state, memory, now, p, v, q, x, estimate, future, STEP, params, net, scratch, command)
    else:
        planner_on_estimate(state, now, p, v, q, x, estimate, future, STEP, params, command)
    action_from_command(command, shared.limits, out)


@njit(parallel=True)
def plan_rows(rows, shared, fresh, source, states, memories, works, futures, scratches, params, net, out):
    """`plan_row` for every row."""
    for i in prange(rows.done.shape[0]):
        plan_row(
            rows, np.int64(i), shared, fresh[i] != 0, source, states[i], memories[i], works[i], futures[i],
            scratches[i], params, net, out[i],
        )  # fmt: skip


class PlannerInEnv:
    """A planner as an `evaluate.Policy`; call it once a step. A new environment starts it anew."""

    def __init__(
        self,
        source: int = LEARNED,
        changes: Mapping[str, float] | None = None,
        steep: Mapping[str, float] | None = None,
    ) -> None:
        """`source`: ANALYTIC or LEARNED; `changes`, `steep`: see `PlannerParams.changed`.

        Raises what `load_predictor` raises.
        """
        self._source, self._changes, self._steep = source, changes or {}, steep
        self._net = load_predictor() if source == LEARNED else np.zeros(0, dtype=np.float32)
        self._env: Env | None = None

    def __call__(self, env: Env) -> np.ndarray:
        """Actions ((N, 4) in [-1, 1], overwritten by the next call)."""
        if env is not self._env:
            self.begin(env)
        fresh, self.first = np.ones_like(env.rows.done) if self.first else env.rows.done, False
        plan_rows(
            env.rows, env.shared, fresh, self._source, self.states, self.memories, self.works, self._futures,
            self._scratches, self.params, self._net, self._out,
        )  # fmt: skip
        return self._out

    def begin(self, env: Env) -> None:
        """Make a planner for every row of `env`; the next call starts all of them."""
        self.first = True
        n = env.config.count
        params = planner_params(env.airframe, by_state=env.config.stage == "state")
        self._env, self.params = env, params.changed(self._changes, self._steep).row()
        self.states, self.memories = np.zeros((n, state_row.DIM)), np.zeros((n, MEMORY_DIM))
        self.works, self._futures = np.zeros((n, _WORK_DIM)), np.zeros((n, HORIZON, 8))
        self._scratches, self._out = np.zeros((n, scratch_row.DIM), dtype=np.float32), np.zeros((n, 4))


class PlannerTeacher:
    """The planner's actions as labels for every row, whatever flies it.

    It receives what the student receives and no more, so that no label depends on anything else.
    """

    def __init__(self, env: Env) -> None:
        self._env = env
        self._planner = PlannerInEnv(LEARNED, _TEACHING, _TEACHING_STEEP)
        self._planner.begin(env)
        self.remaining = np.full(env.config.count, np.inf)

    def state(self) -> dict:
        """The planners, for a checkpoint."""
        return {"states": self._planner.states.copy(), "memories": self._planner.memories.copy()}

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        self._planner.states[:], self._planner.first = state["states"], False
        self._planner.memories[:] = state["memories"]

    def act(self) -> np.ndarray:
        """The actions ((N, 4) in [-1, 1], overwritten by the next call); `remaining` gets the s to each contact."""
        states = self._planner.states
        actions = self._planner(self._env)
        bound = np.isin(states[:, state_row.PHASE], (phases.COMMIT, phases.TERMINAL))
        left = states[:, state_row.CONTACT] - self._env.rows.state[:, episode_row.STEP] * TICK
        self.remaining[:] = np.where(bound, left, np.inf)
        return actions
