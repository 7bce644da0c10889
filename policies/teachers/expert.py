"""An expert for training: it knows the board's future, the motors and the thrust gain, and its choices can be learnt.

A flying planner weighs many ways to end a perch. An expert that is to be imitated must not: what it will do next has to
follow from what the student sees. So thrust and shape of the last move are functions of the inclination alone. A plan
has two parts: a quintic to the state from which the last move begins, then the move itself, whose acceleration swings
from zero to that of the body z axis on the board's normal. Near the board only the second part is planned.
"""

from __future__ import annotations

import math

from kernel.jit import njit
from kernel.rotations import body_z
from policies.environment import episode_row
from policies.environment.config import TICK
from policies.planner import polynomial as poly
from policies.planner.follow import face
from policies.planner.tracking import track_force
from policies.prediction.future import board_at
from policies.teachers.cost import motion_cost
from policies.teachers.params import (
    AXIS,
    E_AIM,
    E_EASE,
    E_FADE,
    E_FLATTEN,
    E_FREEZE,
    E_GIVE_UP,
    E_GLIDE,
    E_IMPACT,
    E_LOCAL,
    E_MISS,
    E_MOVE_FLAT,
    E_MOVE_STEEP,
    E_OVERDUE,
    E_RATE_LAG,
    E_REPLAN,
    E_THRUST_FLAT,
    E_THRUST_LAG,
    E_THRUST_STEEP,
    E_W_POSTPONE,
    E_W_TIME,
    MOTION,
    X_BEGUN,
    X_BOARD,
    X_CONTACT,
    X_COST,
    X_FIRST,
    X_MIDDLE,
    X_NEXT,
    X_READY,
    X_SECOND,
    X_START,
    X_TARGET,
    X_TRY1,
    X_TRY2,
)
from vehicle.quadrotor.airframe import DRAG, GRAVITY, MASS, MOTOR_THRUST
from vehicle.quadrotor.dynamics import MOTOR, P, Q, V

_LONG, _SHORT = 18, 6  # durations tried
_NEAR = (-0.05, -0.025, 0.0, 0.025, 0.05, 0.1)  # s, changes of the contact's time tried for a plan near contact
_LONGEST = 8.4  # the longest duration over the shortest, 0.5 s
_REFINE = 3  # halvings of the step around the best duration


@njit
def _fit_move(row, future, step, contact, e):
    """The last move, ending `contact` s from now: its motion into TRY2, the state it begins with into TARGET.

    Returns its length.
    """
    board, begin = row[X_BOARD : X_BOARD + 8], row[X_TARGET : X_TARGET + 8]
    board_at(future, step, contact, board)
    si, ci = math.sin(board[6]), math.cos(board[6])
    length = e[E_MOVE_FLAT] + si * (e[E_MOVE_STEEP] - e[E_MOVE_FLAT])
    thrust = max(e[E_THRUST_FLAT] * GRAVITY * ci, e[E_THRUST_STEEP])
    ch, sh = math.cos(board[3]), math.sin(board[3])
    nx, ny, nz = -si * ch, -si * sh, ci
    first, second, glide = 0.5 + e[E_EASE] / 6.0, 1.0 / 6.0 + e[E_EASE] / 12.0, e[E_GLIDE] * ci * ci
    for k in range(3):
        n = nx if k == 0 else (ny if k == 1 else nz)
        v = -e[E_IMPACT] * n + (board[4] * ch if k == 0 else (board[4] * sh if k == 1 else 0.0))
        a = thrust * n - (GRAVITY if k == 2 else 0.0)
        p = board[k] + 0.03 * n
        begin[3 + k] = v - a * length * first
        begin[k] = p - begin[3 + k] * length - a * length * length * second
        ahead = ch if k == 0 else (sh if k == 1 else 0.0)
        begin[3 + k] += glide * ahead
        begin[k] -= 0.5 * glide * length * ahead
        poly.fit_axis(begin[k], begin[3 + k], 0.0, p, v, a, length, 0.0, row, X_TRY2 + k * AXIS)
    return length


@njit
def _fit_end(row, future, step, contact, e):
    """From where the drone is straight to the board in `contact` s: into TRY1.

    Late corrections across the normal would tilt the drone, and the board is large: the nearer contact is, the more the
    plan ends where the drone drifts to anyway (end position free), up to a bound.
    """
    board_row, start = row[X_BOARD : X_BOARD + 8], row[X_START : X_START + 9]
    board_at(future, step, contact, board_row)
    si, ci = math.sin(board_row[6]), math.cos(board_row[6])
    thrust = max(e[E_THRUST_FLAT] * GRAVITY * ci, e[E_THRUST_STEEP])
    ch, sh = math.cos(board_row[3]), math.sin(board_row[3])
    natural, end = row[X_TARGET : X_TARGET + 3], row[X_TARGET + 3 : X_TARGET + 9]
    n = (-si * ch, -si * sh, ci)
    along = 0.0
    for k in range(3):
        board = board_row[4] * ch if k == 0 else (board_row[4] * sh if k == 1 else 0.0)
        end[k] = board - e[E_IMPACT] * n[k]
        end[3 + k] = thrust * n[k] - (GRAVITY if k == 2 else 0.0)
        mean, swing = 0.5 * (start[3 + k] + end[k]), (start[6 + k] - end[3 + k]) / 12.0
        natural[k] = start[k] + contact * mean + contact * contact * swing - board_row[k]
        along += natural[k] * n[k]
    miss = 0.0
    for k in range(3):
        natural[k] -= along * n[k]
        miss += natural[k] * natural[k]
    free = min(1.0, max(0.0, (e[E_AIM] - contact) / (0.5 * e[E_AIM])))
    free *= min(1.0, e[E_MISS] / max(math.sqrt(miss), 1e-6))
    for k in range(3):
        p = board_row[k] + 0.03 * n[k] + free * natural[k]
        poly.fit_axis(
            start[k], start[3 + k], start[6 + k], p, end[k], end[3 + k], contact, e[E_FLATTEN], row, X_TRY1 + k * AXIS
        )


@njit
def _try_pair(row, t, contact, late, future, step, gain, drag, e):
    """Try a plan of two parts with contact in `contact` s; keep it if it is the cheapest so far."""
    start, begin = row[X_START : X_START + 9], row[X_TARGET : X_TARGET + 8]
    length = _fit_move(row, future, step, contact, e)
    duration = contact - length
    if duration < 0.1:
        return
    for k in range(3):
        poly.fit_axis(
            start[k], start[3 + k], start[6 + k], begin[k], begin[3 + k], 0.0, duration, 0.0, row, X_TRY1 + k * AXIS
        )
    cost = e[E_W_TIME] * contact + e[E_W_POSTPONE] * max(0.0, late)
    if cost < row[X_COST]:
        cost += motion_cost(row, X_TRY1, duration, 0.0, length, future, step, gain, drag, e, row[X_COST] - cost)
    if cost < row[X_COST]:
        cost += motion_cost(row, X_TRY2, length, duration, 0.0, future, step, gain, drag, e, row[X_COST] - cost)
    if cost < row[X_COST]:
        row[X_COST] = cost
        row[X_FIRST : X_FIRST + 2 * MOTION] = row[X_TRY1 : X_TRY1 + 2 * MOTION]
        row[X_BEGUN], row[X_MIDDLE], row[X_CONTACT] = t, t + duration, t + contact


@njit
def _try_end(row, t, contact, late, future, step, gain, drag, e):
    """Try to go straight to the board in `contact` s; keep it if it is the cheapest so far."""
    _fit_end(row, future, step, contact, e)
    cost = e[E_W_TIME] * contact + e[E_W_POSTPONE] * max(0.0, late)
    if cost < row[X_COST]:
        cost += motion_cost(row, X_TRY1, contact, 0.0, 0.0, future, step, gain, drag, e, row[X_COST] - cost)
    if cost < row[X_COST]:
        row[X_COST] = cost
        row[X_SECOND : X_SECOND + MOTION] = row[X_TRY1 : X_TRY1 + MOTION]
        row[X_BEGUN], row[X_MIDDLE], row[X_CONTACT] = t, t, t + contact


@njit
def _plan(row, t, future, step, gain, drag, e):
    """Plan anew: near contact around the plan under way, else as if there were none.

    A choice that is kept because it was made would be a state that the student does not see.
    """
    left = row[X_CONTACT] - t
    row[X_COST] = math.inf
    if row[X_READY] > 0.0 and -e[E_OVERDUE] < left < e[E_LOCAL]:
        for change in _NEAR:
            _try_end(row, t, max(0.1, left + change), change, future, step, gain, drag, e)
    if row[X_COST] > e[E_GIVE_UP]:
        for k in range(_LONG):
            _try_pair(row, t, 0.5 * _LONGEST ** (k / (_LONG - 1)), 0.0, future, step, gain, drag, e)
        for k in range(_SHORT):
            _try_end(row, t, 0.15 * 4.0 ** (k / (_SHORT - 1)), 0.0, future, step, gain, drag, e)
        span = 0.05 * (row[X_CONTACT] - t)
        for _ in range(_REFINE):
            best, pair = row[X_CONTACT] - t, row[X_MIDDLE] > row[X_BEGUN]
            for side in (-span, span):
                if pair:
                    _try_pair(row, t, best + side, 0.0, future, step, gain, drag, e)
                else:
                    _try_end(row, t, max(0.1, best + side), 0.0, future, step, gain, drag, e)
            span *= 0.5
    row[X_READY] = 1.0 if row[X_COST] < math.inf else 0.0


@njit
def _follow(row, t, vehicle, board, gain, drag, e, planner, out):
    """CTBR that follows the plan at time `t`."""
    second = t >= row[X_MIDDLE]
    at = X_SECOND if second else X_FIRST
    motion = row[at : at + MOTION]
    end = row[X_CONTACT] if second else row[X_MIDDLE]
    begun = row[X_BEGUN] if not second or row[X_MIDDLE] <= row[X_BEGUN] else row[X_MIDDLE]
    duration = end - begun
    now, left = min(duration, t - begun), row[X_CONTACT] - t
    ahead, soon = min(duration, now + e[E_RATE_LAG]), min(duration, now + e[E_THRUST_LAG])
    fade = min(1.0, max(0.0, left / e[E_FADE]))
    p, v, q = vehicle[P : P + 3], vehicle[V : V + 3], vehicle[Q : Q + 4]
    x = row[X_START : X_START + 9]
    for k in range(3):
        gap = 10.0 * (poly.position(motion, k * AXIS, now) - p[k]) + 6.0 * (poly.velocity(motion, k * AXIS, now) - v[k])
        x[k] = fade * gap + drag * v[k] + (GRAVITY if k == 2 else 0.0)
    fx, fy, fz = (
        x[0] + poly.acceleration(motion, 0, now),
        x[1] + poly.acceleration(motion, AXIS, now),
        x[2] + poly.acceleration(motion, 2 * AXIS, now),
    )
    gx, gy, gz = (
        x[0] + poly.acceleration(motion, 0, ahead),
        x[1] + poly.acceleration(motion, AXIS, ahead),
        x[2] + poly.acceleration(motion, 2 * AXIS, ahead),
    )
    jx, jy, jz = poly.jerk(motion, 0, ahead), poly.jerk(motion, AXIS, ahead), poly.jerk(motion, 2 * AXIS, ahead)
    zx, zy, zz = body_z(q)
    thrust = (
        (x[0] + poly.acceleration(motion, 0, soon)) * zx
        + (x[1] + poly.acceleration(motion, AXIS, soon)) * zy
        + (x[2] + poly.acceleration(motion, 2 * AXIS, soon)) * zz
    )
    yaw_rate = face(q, p, board, planner) if left > 0.4 else 0.0
    track_force(q, fx, fy, fz, gx, gy, gz, jx, jy, jz, yaw_rate, thrust, gain, planner, out)


@njit
def expert_step(rows, i, row, board, future, step, gain, e, planner, out):
    """The expert's CTBR for episode i into `out` (4,): body rate rad/s, thrust m/s^2.

    `row` expert row; `board` (8,) the board now, `future` (K, 8) the same `step` s apart from now, read when
    `expert_due`: the truth, or a belief; `gain` achieved over asked thrust; `e` row of ExpertParams; `planner` row of
    PlannerParams for the inner loop's gains.
    """
    vehicle, params, state = rows.vehicle[i], rows.params[i], rows.state[i]
    t = state[episode_row.STEP] * TICK
    drag = params[DRAG] / params[MASS]
    left = row[X_CONTACT] - t
    frozen = row[X_READY] > 0.0 and -e[E_OVERDUE] < left < e[E_FREEZE]
    if expert_due(row, t) and not frozen:
        row[X_NEXT] = t + e[E_REPLAN]
        lift = params[MOTOR_THRUST] / params[MASS]
        lift *= vehicle[MOTOR] + vehicle[MOTOR + 1] + vehicle[MOTOR + 2] + vehicle[MOTOR + 3]
        zx, zy, zz = body_z(vehicle[Q : Q + 4])
        for k in range(3):
            row[X_START + k], row[X_START + 3 + k] = vehicle[P + k], vehicle[V + k]
            z = zx if k == 0 else (zy if k == 1 else zz)
            row[X_START + 6 + k] = lift * z - drag * vehicle[V + k] - (GRAVITY if k == 2 else 0.0)
        _plan(row, t, future, step, gain, drag, e)
    _follow(row, t, vehicle, board, gain, drag, e, planner, out)


@njit
def expert_due(row, t):
    """True if this step will look at the whole future."""
    return t >= row[X_NEXT] - 1e-6
