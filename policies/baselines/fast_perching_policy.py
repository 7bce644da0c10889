"""Fast-Perching in the training environment, as a contender: planned at 10 Hz, tracked by the planner's attitude loop.

The published code has no tracking controller (its odometry is the plan itself). Contact disc, drag and lags are the
airframe's.
"""

from __future__ import annotations

import numpy as np

from groundcar.motion import board_row
from kernel.jit import njit
from kernel.rotations import body_z
from policies.baselines.fast_perching import PerchPlan, load_search, plan_perch
from policies.baselines.fast_perching_params import FastPerchingParams
from policies.environment import episode_row
from policies.environment.config import TICK
from policies.environment.env import Env
from policies.environment.observe import shown_odometry
from policies.estimation import thrust_row
from policies.planner import params_row as pp
from policies.planner.follow import face
from policies.planner.policy import planner_params
from policies.planner.tracking import track_force
from policies.task.observation import action_from_command
from vehicle.quadrotor.airframe import GRAVITY

_REPLAN, _LAST = 0.1, 0.5  # s: between plans; before contact the plan stays
_OFF = 0.3  # m beside the plan, above which the next one starts from the vehicle's state


@njit
def track_plan(now, ahead, soon, left, p, v, q, board, gain, params, limits, out):
    """Normalised action (4,) that follows a plan: its states ((4, 3)) now, a rate lag and a thrust lag ahead.

    `left` s to contact; position feedback fades out before it, as it would turn the body.
    """
    fade = min(1.0, max(0.0, left / params[pp.tracking.fade]))
    kp, kv = params[pp.tracking.kp], params[pp.tracking.kv]
    force, fed, push = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(3):
        back = kp * (now[0, i] - p[i]) + kv * (now[1, i] - v[i])
        still = params[pp.vehicle.drag] * v[i] + (GRAVITY if i == 2 else 0.0)
        force[i] = now[2, i] + fade * back + still
        fed[i] = ahead[2, i] + fade * back + still
        push[i] = soon[2, i] + back + still
    zx, zy, zz = body_z(q)
    thrust = push[0] * zx + push[1] * zy + push[2] * zz
    yaw_rate = face(q, p, board, params) if left > _LAST else 0.0
    jerk = ahead[3] if left > 0.0 else np.zeros(3)
    track_force(
        q, force[0], force[1], force[2], fed[0], fed[1], fed[2], jerk[0], jerk[1], jerk[2], yaw_rate, thrust, gain,
        params, out,
    )  # fmt: skip
    action_from_command(out.copy(), limits, out)


class FastPerching:
    """The method as an `evaluate.Policy`. `turning`: it predicts the board with its turn rate, not straight on."""

    def __init__(self, turning: bool = False) -> None:
        """Raises ValueError as `load_search` does."""
        load_search()
        self._turning = turning
        self._env: Env | None = None

    def __call__(self, env: Env) -> np.ndarray:
        """Actions ((N, 4) in [-1, 1], overwritten by the next call)."""
        if env is not self._env:
            self._begin(env)
        for i in range(env.config.count):
            self._row(env, i)
        return self._out

    def _begin(self, env: Env) -> None:
        count, params = env.config.count, planner_params(env.airframe)
        self._env, self._track = env, params.row()
        self._rate_ahead, self._thrust_lag = params.tracking.rate_ahead, params.vehicle.thrust_lag
        vehicle = params.vehicle
        self._params = FastPerchingParams(
            vehicle.thrust_min, vehicle.thrust_max, vehicle.contact_below, vehicle.contact_radius
        )
        self._plans: list[tuple[PerchPlan, float] | None] = [None] * count
        self._out = np.zeros((count, 4))

    def _row(self, env: Env, i: int) -> None:
        rows = env.rows
        t = rows.state[i, episode_row.STEP] * TICK
        p, v, q = shown_odometry(rows.scratch[i])
        made = None if rows.done[i] else self._plans[i]
        if made is None or (t - made[1] > _REPLAN - 0.5 * TICK and made[0].duration - (t - made[1]) > _LAST):
            made = self._plan(made, t, p, v, rows.believed[i])
        plan, begun = self._plans[i] = made
        ahead = t - begun + self._rate_ahead
        soon = t - begun + self._thrust_lag + 0.5 * TICK
        states = plan.at(t - begun), plan.at(ahead), plan.at(soon)
        left = plan.duration - (t - begun)
        believed, gain, limits = rows.believed[i], rows.gain[i, thrust_row.GAIN], env.shared.limits
        track_plan(*states, left, p, v, q, believed, gain, self._track, limits, self._out[i])

    def _plan(
        self, made: tuple[PerchPlan, float] | None, t: float, p: np.ndarray, v: np.ndarray, seen: np.ndarray
    ) -> tuple[PerchPlan, float]:
        board = seen.copy()
        if not self._turning:
            board[board_row.TURN_RATE] = 0.0
        start = np.zeros((4, 3))
        start[0], start[1] = p, v
        if made is None:
            return plan_perch(start, board, self._params), t
        state = made[0].at(t - made[1])
        if float(np.linalg.norm(state[0] - p)) < _OFF:
            start = state
        return plan_perch(start, board, self._params, (made[0], t - made[1])), t
