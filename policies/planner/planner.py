"""The model-based perching policy: watches, follows, commits to a planned perch, replans it, flies it, or goes around.

It plans on `future` rows only ((K, 8) board rows, see prediction.py): fed by the belief it is a policy that can fly,
fed by the true motion it is the teacher with perfect foresight. One planner is one float64 row ((PLANNER_DIM,)).
"""

from __future__ import annotations

import math

from kernel.jit import njit
from kernel.rotations import body_z
from policies.estimation.board_ekf import B_STREAK, B_T, belief_covariance, belief_valid, surface_sigma
from policies.estimation.ctrv import N
from policies.estimation.own_state import WAIT
from policies.estimation.thrust_drag import G_DRAG, G_GAIN, G_LAGGED, GAIN_DIM, gain_reset, gain_update
from policies.planner import params as pp
from policies.planner.follow import climb_away, follow, hold
from policies.planner.glide import glide
from policies.planner.motion import fly_motion
from policies.planner.runup import flare_gate, fly_runup, met_slow, runs_up, runup_time
from policies.planner.search import MOTION_DIM, search
from policies.prediction.future import carry_swing, predict_swing
from policies.prediction.speed_history import (
    F_SINCE,
    F_SURPRISE,
    FIT_DIM,
    H_TIME,
    HISTORY_DIM,
    fit_swing,
    history_push,
)

HOLD, FOLLOW, COMMIT, TERMINAL, AROUND, RUN_UP, GLIDE = 0, 1, 2, 3, 4, 5, 6
PHASES = ("hold", "follow", "commit", "terminal", "go_around", "run_up", "glide")

# Indices of a planner row.
(S_PHASE, S_BEGUN, S_CONTACT, S_NEXT, S_ENGAGED, S_THRUST, S_COST, S_LAST, S_UNTIL, S_PLANS, S_MISSES, S_GATE, S_AWAY,
 S_ACCELERATION) = range(14)  # fmt: skip
S_ASKED = 14  # 4, CTBR asked last
S_GAIN = S_ASKED + 4
S_MOTION = S_GAIN + GAIN_DIM
S_BEST, S_TRY = S_MOTION + MOTION_DIM, S_MOTION + 2 * MOTION_DIM
S_START = S_MOTION + 3 * MOTION_DIM
S_BOARD = S_START + 9
S_HISTORY = S_BOARD + 8
S_FIT = S_HISTORY + HISTORY_DIM
S_TARGET = S_FIT + FIT_DIM
S_OWN = S_TARGET + 8  # the parameters, with the drag that was found and the impact speed for this belief
PLANNER_DIM = S_OWN + pp.COUNT

# Indices of an estimate row: what the planner asks about the board it is given.
E_VALID, E_SIGMA, E_SPEED_SIGMA, E_AGE, E_STREAK, E_SURPRISE, E_SURFACE = 0, 1, 2, 3, 4, 5, 6
ESTIMATE_DIM = 7

_FRESH = 0.12  # s, age of a belief whose speed is still worth remembering
_NO_RETURN = 0.6  # s before contact, after which a perch is not given up
_TILTED = math.radians(30.0)  # from this inclination on a board is not flat
_WAVER = math.radians(3.0)  # more than that over the limit is not noise
_FASTER = 0.3  # m/s, by which what is known badly is met faster at most
_MANY, _FEW = 22, 10  # durations searched to begin a plan and to renew one


@njit
def planner_reset(state, t, params):
    """Start anew at time `t` (s)."""
    state[:] = 0.0
    state[S_ENGAGED] = -1.0
    state[S_LAST], state[S_NEXT] = t, t
    state[S_ASKED + 3] = params[pp.GRAVITY]
    gain_reset(state[S_GAIN : S_GAIN + GAIN_DIM], params[pp.GRAVITY])


@njit
def planner_due(state, t):
    """True if this tick will look at the whole future and not only at its first row."""
    return t >= state[S_NEXT] - 1e-6


@njit
def certain(estimate):
    """Fill an estimate row for a board that is known exactly."""
    estimate[E_VALID], estimate[E_SIGMA], estimate[E_SPEED_SIGMA], estimate[E_AGE], estimate[E_STREAK] = 1, 0, 0, 0, 1e9
    estimate[E_SURPRISE], estimate[E_SURFACE] = 0, 0


@njit
def estimate_from_belief(row, t, params, x, p, estimate):
    """Fill `estimate` from a belief row at time `t`; `x` (8,) gets the state there, `p` (N * N,) its covariance."""
    belief_covariance(row, t, params, x, p)
    estimate[E_VALID] = 1.0 if belief_valid(row, t, params) else 0.0
    estimate[E_SIGMA] = math.sqrt(max(0.0, 0.5 * (p[0] + p[N + 1])))
    estimate[E_SPEED_SIGMA] = math.sqrt(max(0.0, p[4 * (N + 1)]))
    estimate[E_AGE] = t - row[B_T]
    estimate[E_STREAK] = row[B_STREAK]
    estimate[E_SURFACE] = surface_sigma(row)


@njit
def _start_here(state, p, v, q, params):
    """The motion's start: where the vehicle is, how fast, and the acceleration its thrust gives it now."""
    zx, zy, zz = body_z(q)
    f = state[S_GAIN + G_GAIN] * state[S_GAIN + G_LAGGED]
    drag = params[pp.DRAG]
    for i in range(3):
        state[S_START + i], state[S_START + 3 + i] = p[i], v[i]
    state[S_START + 6] = f * zx - drag * v[0]
    state[S_START + 7] = f * zy - drag * v[1]
    state[S_START + 8] = f * zz - drag * v[2] - params[pp.GRAVITY]


@njit
def _plan(state, t, p, v, q, future, step, shortest, longest, durations, remaining, most, params):
    """Search, and take the plan over if it costs less than `most`. Returns True if it did."""
    _start_here(state, p, v, q, params)
    best, scratch = state[S_BEST : S_BEST + MOTION_DIM], state[S_TRY : S_TRY + MOTION_DIM]
    start, board = state[S_START : S_START + 9], state[S_BOARD : S_BOARD + 8]
    target = state[S_TARGET : S_TARGET + 8]
    gain = state[S_GAIN + G_GAIN]
    cost, duration, thrust = search(
        start, future, step, 0.0, gain, shortest, longest, durations, remaining, params, best, scratch, target, board
    )
    state[S_COST] = cost
    state[S_PLANS] += 1.0
    if not cost < most:
        return False
    state[S_MOTION : S_MOTION + MOTION_DIM] = best
    state[S_BEGUN], state[S_CONTACT], state[S_THRUST] = t, t + duration, thrust
    return True


@njit
def _slack(state, t, params):
    """Grows from 1 with the time since the planner engaged."""
    return 1.0 + max(0.0, t - state[S_ENGAGED]) / max(params[pp.RELAX_AFTER], 1e-3)


@njit
def _ready(state, t, estimate, inclination, params):
    """True if the board is known well enough to commit; the demands relax with the time spent following."""
    slack = _slack(state, t, params)
    return (
        estimate[E_STREAK] >= params[pp.COMMIT_STREAK]
        and estimate[E_AGE] < params[pp.COMMIT_AGE]
        and estimate[E_SIGMA] < params[pp.COMMIT_SIGMA] * slack
        and estimate[E_SPEED_SIGMA] < params[pp.COMMIT_SPEED_SIGMA] * slack
        and estimate[E_SURPRISE] * max(0.3, math.sin(inclination))
        < params[pp.COMMIT_SURPRISE] * (1.0 + (slack - 1.0) * params[pp.RELAX_SURPRISE])
    )


@njit
def _frozen(inclination, params):
    """How long before contact (s) the last plan is kept."""
    flat = max(0.0, 1.0 - inclination / _TILTED)
    return params[pp.FREEZE] + flat * (params[pp.FREEZE_FLAT] - params[pp.FREEZE])


@njit
def _leave(state, t, params):
    """Begin to climb away; returns the phase."""
    state[S_UNTIL] = t + params[pp.AROUND_TIME]
    return AROUND


@njit
def _decide(state, t, p, v, q, board, estimate, future, step, params):
    """Move between the phases; plans when due."""
    phase = state[S_PHASE]
    if phase == HOLD and estimate[E_VALID] > 0.0:
        phase = FOLLOW
        if state[S_ENGAGED] < 0.0:
            state[S_ENGAGED] = t
    if phase == AROUND and t >= state[S_UNTIL] and v[2] > 0.0:
        phase = FOLLOW
    if phase in (FOLLOW, GLIDE) and estimate[E_VALID] <= 0.0:
        phase = HOLD
    # What is known exactly need not be seen.
    if phase == FOLLOW and abs(board[6]) < params[pp.GLIDE_INCLINATION] and estimate[E_SIGMA] > 0.0:
        phase = GLIDE
    if phase == GLIDE and abs(board[6]) > params[pp.GLIDE_INCLINATION] + _WAVER:
        phase = FOLLOW
    left = state[S_CONTACT] - t
    if phase == COMMIT and left < _frozen(board[6], params):
        phase = TERMINAL
    if phase == TERMINAL and left < -params[pp.MISS_AFTER]:
        phase = _leave(state, t, params)
        state[S_MISSES] += 1.0
    if phase == RUN_UP and (t > state[S_GATE] + 0.15 or estimate[E_AGE] > params[pp.LOST_AGE]):
        phase = _leave(state, t, params)
    if planner_due(state, t):
        state[S_NEXT] = t + params[pp.REPLAN]
        state[S_ACCELERATION] = (future[1, 4] - future[0, 4]) / step
        if phase == COMMIT:
            low, high = max(0.12, left - 0.15), left + 0.3
            kept = _plan(state, t, p, v, q, future, step, low, high, _FEW, left, params[pp.ABORT_COST], params)
            # Too late to leave, the plan under way is better than none.
            if left > _NO_RETURN and (not kept or estimate[E_AGE] > params[pp.LOST_AGE]):
                phase = FOLLOW
        elif phase == RUN_UP:
            gate = state[S_GATE] - t
            if gate < params[pp.RUN_COMMIT]:
                flare = flare_gate(board[6], params)[4]
                low, high = max(0.3, gate + flare - 0.1), gate + flare + 0.4
                if _plan(state, t, p, v, q, future, step, low, high, _FEW, 0.0, params[pp.RUN_COST], params):
                    phase = COMMIT
        elif phase == FOLLOW and runs_up(board, params):
            straight = abs(board[5]) < params[pp.RUN_TURN] * _slack(state, t, params)
            near = state[S_AWAY] < params[pp.RUN_AWAY] * _slack(state, t, params)
            share = params[pp.RUN_SWING] * _slack(state, t, params)
            history = state[S_HISTORY : S_HISTORY + HISTORY_DIM]
            slow = met_slow(future, step, board[6], share, history, params)
            if near and straight and slow and _ready(state, t, estimate, board[6], params):
                phase = RUN_UP
                state[S_GATE] = t + runup_time(board[6], params)
        elif (
            phase == FOLLOW
            and _ready(state, t, estimate, board[6], params)
            and _plan(
                state,
                t,
                p,
                v,
                q,
                future,
                step,
                params[pp.T_MIN],
                params[pp.T_MAX],
                _MANY,
                0.0,
                params[pp.COMMIT_COST] / math.cos(min(1.3, board[6])),
                params,
            )
        ):
            phase = COMMIT
    state[S_PHASE] = phase


@njit
def _glide(state, t, p, v, q, board, estimate, params, out):
    """Fly the way down in sight; a miss is climbed away from."""
    if glide(p, v, q, board, state[S_ACCELERATION], estimate[E_AGE], state[S_GAIN + G_GAIN], params, out):
        state[S_PHASE] = _leave(state, t, params)
        state[S_MISSES] += 1.0


@njit
def planner_step(state, t, p, v, q, board, estimate, future, step, params, out):
    """One control tick of one vehicle. Returns the phase (HOLD: not engaged, the command is a hover).

    `t` s; `p`, `v` (3,) world, `q` (4,) world from body: the vehicle's own estimate; `board` (8,) the board now;
    `estimate` (ESTIMATE_DIM,); `future` (K, 8) at `step` s, whose first row is now: read only if `planner_due`;
    `params` row of PlannerParams; `out` (4,): body rate FLU (rad/s), collective thrust (m/s^2).
    """
    if runs_up(board, params):
        params = params[pp.COUNT :]
    return _step(state, t, p, v, q, board, estimate, future, step, params, out)


@njit
def _step(state, t, p, v, q, board, estimate, future, step, params, out):
    zx, zy, zz = body_z(q)
    gain = gain_update(
        state[S_GAIN : S_GAIN + GAIN_DIM], v[0], v[1], v[2], zx, zy, zz, state[S_ASKED + 3], t - state[S_LAST],
        params[pp.THRUST_LAG] + WAIT, params[pp.DRAG], params[pp.GRAVITY],
    )  # fmt: skip
    state[S_LAST] = t
    own = state[S_OWN : S_OWN + pp.COUNT]
    own[:] = params[: pp.COUNT]
    own[pp.DRAG] = state[S_GAIN + G_DRAG]
    own[pp.IMPACT_SPEED] += min(_FASTER, own[pp.IMPACT_UNSURE] * estimate[E_SURFACE])
    params = own
    _decide(state, t, p, v, q, board, estimate, future, step, params)
    phase = int(state[S_PHASE])
    if phase == HOLD:
        hold(q, v, 0.3 if state[S_ENGAGED] >= 0.0 else 0.0, gain, params, out)
    elif phase == RUN_UP or (phase == FOLLOW and runs_up(board, params)):
        resting = phase == FOLLOW
        left = runup_time(board[6], params) if resting else state[S_GATE] - t
        error, rate = fly_runup(left, resting, p, v, q, board, state[S_ACCELERATION], gain, params, out)
        state[S_AWAY] = error + 0.3 * rate
    elif phase == FOLLOW:
        follow(p, v, q, board, 0.8 * min(2.0, max(0.0, estimate[E_AGE] - 0.3)), gain, params, out)
    elif phase == AROUND:
        climb_away(p, v, q, board, gain, params, out)
    elif phase == GLIDE:
        _glide(state, t, p, v, q, board, estimate, params, out)
    else:
        motion, begun, contact = state[S_MOTION : S_MOTION + MOTION_DIM], state[S_BEGUN], state[S_CONTACT]
        given = gain * state[S_GAIN + G_LAGGED]
        fly_motion(
            motion, t - begun, contact - begun, contact - t, p, v, q, board, state[S_ACCELERATION], gain, given,
            estimate[E_SURFACE], params, out,
        )  # fmt: skip
    state[S_ASKED : S_ASKED + 4] = out
    return phase


@njit
def planner_on_estimate(state, t, p, v, q, x, estimate, future, step, params, out):
    """`planner_step` on an estimate of the board now: remembers its speed and, when due, predicts `future` ((K, 8)).

    `x` (8,): board row whose last entry is the acceleration (m/s^2), which decays in
    `predict_tau` s; corrected in place for what the board did since the last exposure.
    """
    if runs_up(x, params):
        params = params[pp.COUNT :]
    history, fit = state[S_HISTORY : S_HISTORY + HISTORY_DIM], state[S_FIT : S_FIT + FIT_DIM]
    if estimate[E_VALID] > 0.0 and estimate[E_AGE] < _FRESH:
        history_push(history, t, x[4])
    tau = params[pp.PREDICT_TAU]
    if planner_due(state, t):
        fit_swing(history, tau, fit)
        estimate[E_SURPRISE] = fit[F_SURPRISE]
    fit[F_SINCE] = t - history[H_TIME]
    carry_swing(x, fit, estimate[E_AGE], params[pp.FILTER_TAU])
    if planner_due(state, t):
        predict_swing(x, fit, tau, step, future)
    return _step(state, t, p, v, q, x, estimate, future, step, params, out)
