"""The planner's phases: when it follows, commits to a plan, replans, gives up, and climbs away from a miss."""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.jit import njit
from kernel.rotations import body_z
from policies.estimation import thrust_row
from policies.planner import estimate_row, phases, state_row
from policies.planner import params_row as pp
from policies.planner.runup import flare_start, met_slow, runs_up, runup_time
from policies.planner.search import MOTION_DIM, search
from policies.prediction.speed_history import HISTORY_DIM
from vehicle.quadrotor.airframe import GRAVITY

_NO_RETURN = 0.6  # s before contact, after which a perch is not given up
_TILTED = math.radians(30.0)  # from this inclination on a board is not flat
_WAVER = math.radians(3.0)  # margin over the glide's limit before a glide ends, so that noise does not end it
_MANY, _FEW = 22, 10  # durations searched to begin a plan and to renew one


@njit
def planner_due(state, t):
    """True if this tick reads the whole future and not only its first row."""
    return t >= state[state_row.NEXT] - 1e-6


@njit
def _start_here(state, p, v, q, params):
    """The motion's start: where the vehicle is, how fast, and the acceleration its thrust gives it now."""
    zx, zy, zz = body_z(q)
    f = state[state_row.GAIN + thrust_row.GAIN] * state[state_row.GAIN + thrust_row.LAGGED]
    drag = params[pp.vehicle.drag]
    for i in range(3):
        state[state_row.START + i], state[state_row.START + 3 + i] = p[i], v[i]
    state[state_row.START + 6] = f * zx - drag * v[0]
    state[state_row.START + 7] = f * zy - drag * v[1]
    state[state_row.START + 8] = f * zz - drag * v[2] - GRAVITY


@njit
def _plan(state, t, p, v, q, future, step, shortest, longest, durations, remaining, most, params):
    """Search, and take the plan over if it costs less than `most`. Returns True if it did."""
    _start_here(state, p, v, q, params)
    best, scratch = (
        state[state_row.BEST : state_row.BEST + MOTION_DIM],
        state[state_row.TRY : state_row.TRY + MOTION_DIM],
    )
    start, board = (
        state[state_row.START : state_row.START + 9],
        state[state_row.BOARD : state_row.BOARD + board_row.DIM],
    )
    target = state[state_row.TARGET : state_row.TARGET + board_row.DIM]
    gain = state[state_row.GAIN + thrust_row.GAIN]
    cost, duration, thrust = search(
        start, future, step, 0.0, gain, shortest, longest, durations, remaining, params, best, scratch, target, board
    )
    state[state_row.COST] = cost
    state[state_row.PLANS] += 1.0
    if not cost < most:
        return False
    state[state_row.MOTION : state_row.MOTION + MOTION_DIM] = best
    state[state_row.BEGUN], state[state_row.CONTACT], state[state_row.THRUST] = t, t + duration, thrust
    return True


@njit
def _slack(state, t, params):
    """Factor on the allowed uncertainty; it grows from 1 with the time since the planner engaged."""
    return 1.0 + max(0.0, t - state[state_row.ENGAGED]) / max(params[pp.commit.relax_after], 1e-3)


@njit
def _ready(state, t, estimate, inclination, params):
    """True if the board is known well enough to commit; the demands relax with the time spent following."""
    slack = _slack(state, t, params)
    return (
        estimate[estimate_row.STREAK] >= params[pp.commit.streak]
        and estimate[estimate_row.AGE] < params[pp.commit.age]
        and estimate[estimate_row.SIGMA] < params[pp.commit.sigma] * slack
        and estimate[estimate_row.SPEED_SIGMA] < params[pp.commit.speed_sigma] * slack
        and estimate[estimate_row.SURPRISE] * max(0.3, math.sin(inclination))
        < params[pp.commit.surprise] * (1.0 + (slack - 1.0) * params[pp.commit.relax_surprise])
    )


@njit
def _frozen(inclination, params):
    """How long before contact (s) the last plan is kept."""
    flat = max(0.0, 1.0 - inclination / _TILTED)
    return params[pp.search.freeze] + flat * (params[pp.search.freeze_flat] - params[pp.search.freeze])


@njit
def leave(state, t, params):
    """Begin to climb away; returns the phase."""
    state[state_row.UNTIL] = t + params[pp.commit.climb]
    return phases.AROUND


@njit
def decide(state, t, p, v, q, board, estimate, future, step, params):
    """Change the phase where its conditions hold, and plan when due. Arguments as of `planner.planner_step`."""
    phase = state[state_row.PHASE]
    if phase == phases.HOLD and estimate[estimate_row.VALID] > 0.0:
        phase = phases.FOLLOW
        if state[state_row.ENGAGED] < 0.0:
            state[state_row.ENGAGED] = t
    if phase == phases.AROUND and t >= state[state_row.UNTIL] and v[2] > 0.0:
        phase = phases.FOLLOW
    if phase in (phases.FOLLOW, phases.GLIDE) and estimate[estimate_row.VALID] <= 0.0:
        phase = phases.HOLD
    # A board that is known exactly need not be kept in view.
    if (
        phase == phases.FOLLOW
        and abs(board[board_row.INCLINATION]) < params[pp.glide.inclination]
        and estimate[estimate_row.SIGMA] > 0.0
    ):
        phase = phases.GLIDE
    if phase == phases.GLIDE and abs(board[board_row.INCLINATION]) > params[pp.glide.inclination] + _WAVER:
        phase = phases.FOLLOW
    left = state[state_row.CONTACT] - t
    if phase == phases.COMMIT and left < _frozen(board[board_row.INCLINATION], params):
        phase = phases.TERMINAL
    if phase == phases.TERMINAL and left < -params[pp.commit.overdue]:
        phase = leave(state, t, params)
        state[state_row.MISSES] += 1.0
    if phase == phases.RUN_UP and (
        t > state[state_row.FLARE] + 0.15 or estimate[estimate_row.AGE] > params[pp.commit.lost_age]
    ):
        phase = leave(state, t, params)
    if planner_due(state, t):
        state[state_row.NEXT] = t + params[pp.search.period]
        state[state_row.ACCELERATION] = (future[1, board_row.SPEED] - future[0, board_row.SPEED]) / step
        if phase == phases.COMMIT:
            low, high = max(0.12, left - 0.15), left + 0.3
            kept = _plan(state, t, p, v, q, future, step, low, high, _FEW, left, params[pp.commit.abort_cost], params)
            # Too late to leave, the plan under way is better than none.
            if left > _NO_RETURN and (not kept or estimate[estimate_row.AGE] > params[pp.commit.lost_age]):
                phase = phases.FOLLOW
        elif phase == phases.RUN_UP:
            ahead = state[state_row.FLARE] - t
            if ahead < params[pp.run_up.commit]:
                flare = flare_start(board[board_row.INCLINATION], params)[4]
                low, high = max(0.3, ahead + flare - 0.1), ahead + flare + 0.4
                if _plan(state, t, p, v, q, future, step, low, high, _FEW, 0.0, params[pp.run_up.cost], params):
                    phase = phases.COMMIT
        elif phase == phases.FOLLOW and runs_up(board, params):
            straight = abs(board[board_row.TURN_RATE]) < params[pp.run_up.turn] * _slack(state, t, params)
            near = state[state_row.AWAY] < params[pp.run_up.away] * _slack(state, t, params)
            share = params[pp.run_up.slow_share] * _slack(state, t, params)
            history = state[state_row.HISTORY : state_row.HISTORY + HISTORY_DIM]
            slow = met_slow(future, step, board[board_row.INCLINATION], share, history, params)
            if near and straight and slow and _ready(state, t, estimate, board[board_row.INCLINATION], params):
                phase = phases.RUN_UP
                state[state_row.FLARE] = t + runup_time(board[board_row.INCLINATION], params)
        elif (
            phase == phases.FOLLOW
            and _ready(state, t, estimate, board[board_row.INCLINATION], params)
            and _plan(
                state,
                t,
                p,
                v,
                q,
                future,
                step,
                params[pp.search.duration_min],
                params[pp.search.duration_max],
                _MANY,
                0.0,
                params[pp.commit.cost] / math.cos(min(1.3, board[board_row.INCLINATION])),
                params,
            )
        ):
            phase = phases.COMMIT
    state[state_row.PHASE] = phase
