"""The model-based perching policy: it follows the board, commits to a planned perch, replans it, or goes around.

It plans on `future` rows only ((K, 8) board rows, see `future.py`), which come from the belief. One planner is one
float64 row (`state_row`); how well the board is known is another (`estimate_row`).
"""

from __future__ import annotations

from groundcar.motion import board_row
from kernel.clip import clip
from kernel.jit import njit
from kernel.rotations import body_z
from policies.estimation import belief_state, thrust_row
from policies.estimation.own_state import WAIT
from policies.estimation.thrust_drag import gain_reset, gain_update
from policies.planner import estimate_row, phases, state_row
from policies.planner import params_row as pp
from policies.planner.decide import decide, leave, planner_due
from policies.planner.follow import climb_away, follow, hold
from policies.planner.glide import glide
from policies.planner.motion import fly_motion
from policies.planner.runup import fly_runup, runs_up, runup_time
from policies.planner.search import MOTION_DIM
from policies.prediction import oscillation_row, speeds_row
from policies.prediction.future import carry_oscillation, predict_oscillation
from policies.prediction.speed_history import HISTORY_DIM, fit_oscillation, history_push
from vehicle.quadrotor import command_row
from vehicle.quadrotor.airframe import GRAVITY

_FRESH = 0.12  # s, age up to which a belief's speed enters the speed history
_FASTER = 0.3  # m/s at most by which a board is met faster when its surface is uncertain


@njit
def planner_reset(state, t):
    """Start anew at time `t` (s)."""
    state[:] = 0.0
    state[state_row.ENGAGED] = -1.0
    state[state_row.LAST], state[state_row.NEXT] = t, t
    state[state_row.ASKED + 3] = GRAVITY
    gain_reset(state[state_row.GAIN : state_row.GAIN + thrust_row.DIM], GRAVITY)


@njit
def _fly_glide(state, t, p, v, q, board, estimate, params, out):
    """Fly the glide; after a miss begin to climb away."""
    age, gain = estimate[estimate_row.AGE], state[state_row.GAIN + thrust_row.GAIN]
    if glide(p, v, q, board, state[state_row.ACCELERATION], age, gain, params, out):
        state[state_row.PHASE] = leave(state, t, params)
        state[state_row.MISSES] += 1.0


@njit
def planner_step(state, t, p, v, q, board, estimate, future, step, params, out):
    """One control tick of one vehicle. Returns the phase (phases.HOLD: not engaged, the command is a hover).

    `t` s; `p`, `v` (3,) world, `q` (4,) world from body: the vehicle's own estimate; `board` (8,) the board now;
    `estimate` (estimate_row.DIM,); `future` (K, 8) at `step` s, whose first row is now: read only if `planner_due`;
    `params` row of PlannerParams; `out` (4,): body rate FLU (rad/s), collective thrust (m/s^2).
    """
    if runs_up(board, params):
        params = params[pp.COUNT :]
    return _step(state, t, p, v, q, board, estimate, future, step, params, out)


@njit
def _step(state, t, p, v, q, board, estimate, future, step, params, out):
    zx, zy, zz = body_z(q)
    dt, lag = t - state[state_row.LAST], params[pp.vehicle.thrust_lag] + WAIT
    gain = gain_update(
        state[state_row.GAIN : state_row.GAIN + thrust_row.DIM], v[0], v[1], v[2], zx, zy, zz,
        state[state_row.ASKED + command_row.THRUST], dt, lag, params[pp.vehicle.drag], GRAVITY,
    )  # fmt: skip
    state[state_row.LAST] = t
    own = state[state_row.OWN : state_row.OWN + pp.COUNT]
    own[:] = params[: pp.COUNT]
    own[pp.vehicle.drag] = state[state_row.GAIN + thrust_row.DRAG]
    own[pp.contact.speed] += min(_FASTER, own[pp.contact.speed_by_sigma] * estimate[estimate_row.SURFACE])
    params = own
    decide(state, t, p, v, q, board, estimate, future, step, params)
    phase = int(state[state_row.PHASE])
    if phase == phases.HOLD:
        hold(q, v, 0.3 if state[state_row.ENGAGED] >= 0.0 else 0.0, gain, params, out)
    elif phase == phases.RUN_UP or (phase == phases.FOLLOW and runs_up(board, params)):
        resting = phase == phases.FOLLOW
        left = runup_time(board[board_row.INCLINATION], params) if resting else state[state_row.FLARE] - t
        error, rate = fly_runup(left, resting, p, v, q, board, state[state_row.ACCELERATION], gain, params, out)
        state[state_row.AWAY] = error + 0.3 * rate
    elif phase == phases.FOLLOW:
        follow(p, v, q, board, 0.8 * clip(estimate[estimate_row.AGE] - 0.3, 0.0, 2.0), gain, params, out)
    elif phase == phases.AROUND:
        climb_away(p, v, q, board, gain, params, out)
    elif phase == phases.GLIDE:
        _fly_glide(state, t, p, v, q, board, estimate, params, out)
    else:
        motion, begun, contact = (
            state[state_row.MOTION : state_row.MOTION + MOTION_DIM],
            state[state_row.BEGUN],
            state[state_row.CONTACT],
        )
        given = gain * state[state_row.GAIN + thrust_row.LAGGED]
        fly_motion(
            motion, t - begun, contact - begun, contact - t, p, v, q, board, state[state_row.ACCELERATION], gain, given,
            estimate[estimate_row.SURFACE], params, out,
        )  # fmt: skip
    state[state_row.ASKED : state_row.ASKED + 4] = out
    return phase


@njit
def planner_on_estimate(state, t, p, v, q, x, estimate, future, step, params, out):
    """`planner_step` on an estimate of the board now: stores its speed and, when due, predicts `future` ((K, 8)).

    `x` (8,): the predicted belief state (policies.estimation.belief_state); its acceleration (m/s^2) decays in
    `Prediction.acceleration_tau` s; corrected in place for what the board did since the last exposure.
    """
    if runs_up(x, params):
        params = params[pp.COUNT :]
    history, fit = (
        state[state_row.HISTORY : state_row.HISTORY + HISTORY_DIM],
        state[state_row.FIT : state_row.FIT + oscillation_row.DIM],
    )
    if estimate[estimate_row.VALID] > 0.0 and estimate[estimate_row.AGE] < _FRESH:
        history_push(history, t, x[belief_state.SPEED])
    tau = params[pp.prediction.acceleration_tau]
    if planner_due(state, t):
        fit_oscillation(history, tau, fit)
        estimate[estimate_row.SURPRISE] = fit[oscillation_row.SURPRISE]
    fit[oscillation_row.SINCE] = t - history[speeds_row.TIME]
    carry_oscillation(x, fit, estimate[estimate_row.AGE], params[pp.prediction.filter_tau])
    if planner_due(state, t):
        predict_oscillation(x, fit, tau, step, future)
    return _step(state, t, p, v, q, x, estimate, future, step, params, out)
