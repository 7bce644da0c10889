"""The planners as contenders in the training environment: flown on the rows that a network's observation is built from.

They get what a flight would give them: the belief filter (or, in the state stage, the true board now and its past),
the vehicle's own estimate with odometry noise, and the thrust they asked for. Never the future.
"""

from __future__ import annotations

import numpy as np

from kernel import njit, prange
from policies.env import Env
from policies.env_config import C_VISION, TICK
from policies.env_rows import S_COMMAND, S_STEP, X_P, X_Q, X_V
from policies.observation import action_from_command
from policies.planner import (
    ESTIMATE_DIM,
    PLANNER_DIM,
    S_ASKED,
    S_GAIN,
    certain,
    estimate_from_belief,
    planner_on_estimate,
    planner_reset,
)
from policies.planner_policy import planner_params
from policies.prediction import HORIZON, STEP
from policies.predictor import SCRATCH_DIM, load_predictor
from policies.predictor_planner import MEMORY_DIM, planner_on_learned
from policies.thrust_gain import GAIN_DIM

_LAG = 5  # control steps over which the state stage's acceleration is taken

# Slices of a work row.
_BOARD, _COVARIANCE, _ESTIMATE, _COMMAND = 0, 8, 72, 72 + ESTIMATE_DIM
_WORK_DIM = _COMMAND + 4


@njit
def _board_now(rows, i, shared, now, x, covariance, estimate):
    """What is known of the board: state and acceleration into `x` (8,), how well into `estimate`."""
    if shared.config[C_VISION] > 0.0:
        estimate_from_belief(rows.belief[i], now, shared.belief, x, covariance, estimate)
        return
    certain(estimate)
    step = int(rows.state[i, S_STEP])
    x[:] = rows.believed[i]
    lag = min(_LAG, step)
    x[7] = (rows.track[i, step, 4] - rows.track[i, step - lag, 4]) / (lag * TICK) if lag > 0 else 0.0


@njit
def plan_row(rows, i, shared, fresh, learned, state, memory, work, future, scratch, params, net, out):
    """The planner's action for row i now, into `out` (4,) in [-1, 1]; `fresh`: an episode begins.

    `state` (PLANNER_DIM,), `memory` (predictor_planner.MEMORY_DIM,) are the row's planner; `work`, `future`
    ((HORIZON, 8)), `scratch` are scratch. `learned`: the future comes from `net`, else from the analytic prediction.
    """
    now = rows.state[i, S_STEP] * TICK
    if fresh:
        planner_reset(state, now, params)
        memory[:] = 0.0
        state[S_GAIN : S_GAIN + GAIN_DIM] = rows.gain[i]  # the hover before the episode has shown it
        state[S_ASKED] = rows.state[i, S_COMMAND + 3]
    x, estimate = work[_BOARD : _BOARD + 8], work[_ESTIMATE : _ESTIMATE + ESTIMATE_DIM]
    command, own = work[_COMMAND : _COMMAND + 4], rows.scratch[i]
    _board_now(rows, i, shared, now, x, work[_COVARIANCE : _COVARIANCE + 64], estimate)
    p, v, q = own[X_P : X_P + 3], own[X_V : X_V + 3], own[X_Q : X_Q + 4]
    if learned:
        planner_on_learned(state, memory, now, p, v, q, x, estimate, future, STEP, params, net, scratch, command)
    else:
        planner_on_estimate(state, now, p, v, q, x, estimate, future, STEP, params, command)
    action_from_command(command, out)


@njit(parallel=True)
def plan_rows(rows, shared, fresh, learned, states, memories, works, futures, scratches, params, net, out):
    """`plan_row` for every row."""
    for i in prange(rows.done.shape[0]):
        plan_row(
            rows, i, shared, fresh[i] != 0, learned, states[i], memories[i], works[i], futures[i], scratches[i],
            params, net, out[i],
        )  # fmt: skip


class PlannerInEnv:
    """A planner as an `evaluate.Policy`; call it once a step. A new environment starts it anew."""

    def __init__(self, learned: bool = True) -> None:
        """`learned`: with the motion predictor's network. Raises what `predictor.load_predictor` raises."""
        self._learned = learned
        self._net = load_predictor() if learned else np.zeros(0, dtype=np.float32)
        self._env: Env | None = None

    def __call__(self, env: Env) -> np.ndarray:
        """Actions ((N, 4) in [-1, 1], overwritten by the next call)."""
        fresh = env.rows.done
        if env is not self._env:
            self._begin(env)
            fresh = np.ones_like(fresh)
        plan_rows(
            env.rows, env.shared, fresh, self._learned, self._states, self._memories, self._works, self._futures,
            self._scratches, self._params, self._net, self._out,
        )  # fmt: skip
        return self._out

    def _begin(self, env: Env) -> None:
        n = env.config.count
        self._env, self._params = env, planner_params(env.airframe).row()
        self._states, self._memories = np.zeros((n, PLANNER_DIM)), np.zeros((n, MEMORY_DIM))
        self._works, self._futures = np.zeros((n, _WORK_DIM)), np.zeros((n, HORIZON, 8))
        self._scratches, self._out = np.zeros((n, SCRATCH_DIM), dtype=np.float32), np.zeros((n, 4))
