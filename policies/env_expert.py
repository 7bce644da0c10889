"""An expert for training: it knows the board's future, the motors and the thrust gain, and its choices can be learnt.

A flying planner weighs many ways to end a perch. An expert that is to be imitated must not: what it will do next has to
follow from what the student sees. So thrust and shape of the last move are functions of the inclination alone. A plan
has two parts: a quintic to the state from which the last move begins, then the move itself, whose acceleration swings
from zero to that of the body z axis on the board's normal. Near the board only the second part is planned.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np

from kernel import njit
from policies import planner_polynomial as poly
from policies.env_config import TICK
from policies.env_rows import S_STEP
from policies.planner_follow import face
from policies.prediction import platform_at
from policies.tracking import track_force
from vehicle.airframe import DRAG, GRAVITY, MASS, MOTOR_THRUST
from vehicle.dynamics import MOTOR, P, Q, V
from vehicle.rotations import body_z

# Indices of an expert row.
X_READY, X_BEGUN, X_MIDDLE, X_CONTACT, X_NEXT, X_COST = 0, 1, 2, 3, 4, 5
_C = poly.COEFFICIENTS
_M = 3 * _C
X_FIRST, X_SECOND = 6, 6 + _M
X_TRY1, X_TRY2 = 6 + 2 * _M, 6 + 3 * _M
X_START, X_TARGET, X_PLATFORM = 6 + 4 * _M, 15 + 4 * _M, 24 + 4 * _M
EXPERT_DIM = 32 + 4 * _M

(E_IMPACT, E_THRUST_FLAT, E_THRUST_STEEP, E_MOVE_FLAT, E_MOVE_STEEP, E_EASE, E_REPLAN, E_FREEZE, E_FADE,
 E_RATE_LAG, E_THRUST_LAG, E_LOW, E_HIGH, E_RATE, E_W_TIME, E_W_POSTPONE, E_W_THRUST, E_W_RATE, E_W_CLEARANCE,
 E_W_SPEED, E_SPEED, E_GIVE_UP, E_OVERDUE, E_AIM, E_MISS, E_W_SMOOTH, E_LOCAL, E_FLATTEN, E_W_VIEW,
 E_BLIND, E_GLIDE, E_RATE_FLAT) = range(32)  # fmt: skip

_SAMPLES = 12
_REACH = 0.6  # m, clearance over the board's plane is asked only this near to the board
_GROUND = 0.35  # m
_TILT, _HALF_VIEW = math.radians(15.0), math.radians(22.0)  # camera below body x, half its vertical field of view
_LONG, _SHORT = 18, 6  # durations tried
_NEAR = (-0.05, -0.025, 0.0, 0.025, 0.05, 0.1)  # s, changes of the contact's time tried for a plan near contact
_LONGEST = 8.4  # the longest duration over the shortest, 0.5 s
_REFINE = 3  # halvings of the step around the best duration


@dataclass(frozen=True)
class ExpertParams:
    """How the expert perches. SI units, rad.

    `impact`: speed into the board. Thrust at contact: `thrust_flat` (of gravity's part along the normal), but at least
    `thrust_steep` m/s^2. Length of the last move: from `move_flat` s on a flat board to `move_steep` on a vertical one;
    `ease` 0..1 takes that share of the body rate at contact away. `replan` s; no plan is made in the last `freeze` s;
    position feedback fades out over the last `fade` s. `rate_lag`, `thrust_lag`: feed-forward ahead. Limits: `low` to
    `high` thrust asked, and `rate`, but less over boards below 30 deg, down to `rate_flat`: what could not turn any
    faster is not aligned in time where a flat board bends away. Within `aim` s of contact the plan need not end on the
    centre, by up to `miss` m. `w_*` weights of the cost. Within `local` s the plan under way is kept up, unless its
    cost is above `give_up` or it is `overdue` s late; `flatten` as `ease`, for what is planned then.
    `glide`: speed at which the last move begins to close in from behind, on a flat board, so that the camera keeps it.
    `w_view`: cost of a second with the board out of the camera's view, but not in the last `blind` s.
    """

    impact: float = 0.42
    thrust_flat: float = 0.9
    thrust_steep: float = 11.6
    move_flat: float = 0.4
    move_steep: float = 0.455
    ease: float = 0.86
    replan: float = 0.05
    freeze: float = 0.2
    fade: float = 0.22
    rate_lag: float = 0.031
    thrust_lag: float = 0.05
    low: float = 4.72
    high: float = 14.0
    rate: float = 3.0
    w_time: float = 4.9
    w_postpone: float = 2.8
    w_thrust: float = 2.8
    w_rate: float = 1.5
    w_clearance: float = 1000.0
    w_speed: float = 2.0
    speed: float = 5.0
    give_up: float = 140.0
    overdue: float = 0.19
    aim: float = 0.73
    miss: float = 0.1
    w_smooth: float = 0.09
    local: float = 0.79
    flatten: float = 0.12
    w_view: float = 6.0
    blind: float = 0.5
    glide: float = 0.5
    rate_flat: float = 2.3

    def row(self) -> np.ndarray:
        """The row for kernels."""
        return np.array(astuple(self), dtype=np.float64)


@njit
def _fit_move(row, future, step, contact, e):
    """The last move, ending `contact` s from now: its motion into TRY2, the state it begins with into TARGET.

    Returns its length.
    """
    platform, begin = row[X_PLATFORM : X_PLATFORM + 8], row[X_TARGET : X_TARGET + 8]
    platform_at(future, step, contact, platform)
    si, ci = math.sin(platform[6]), math.cos(platform[6])
    length = e[E_MOVE_FLAT] + si * (e[E_MOVE_STEEP] - e[E_MOVE_FLAT])
    thrust = max(e[E_THRUST_FLAT] * GRAVITY * ci, e[E_THRUST_STEEP])
    ch, sh = math.cos(platform[3]), math.sin(platform[3])
    nx, ny, nz = -si * ch, -si * sh, ci
    first, second, glide = 0.5 + e[E_EASE] / 6.0, 1.0 / 6.0 + e[E_EASE] / 12.0, e[E_GLIDE] * ci * ci
    for k in range(3):
        n = nx if k == 0 else (ny if k == 1 else nz)
        v = -e[E_IMPACT] * n + (platform[4] * ch if k == 0 else (platform[4] * sh if k == 1 else 0.0))
        a = thrust * n - (GRAVITY if k == 2 else 0.0)
        p = platform[k] + 0.03 * n
        begin[3 + k] = v - a * length * first
        begin[k] = p - begin[3 + k] * length - a * length * length * second
        ahead = ch if k == 0 else (sh if k == 1 else 0.0)
        begin[3 + k] += glide * ahead
        begin[k] -= 0.5 * glide * length * ahead
        poly.fit_axis(begin[k], begin[3 + k], 0.0, p, v, a, length, 0.0, row, X_TRY2 + k * _C)
    return length


@njit
def _fit_end(row, future, step, contact, e):
    """From where the drone is straight to the board in `contact` s: into TRY1.

    Late corrections across the normal would tilt the drone, and the board is large: the nearer contact is, the more the
    plan ends where the drone drifts to anyway (end position free), up to a bound.
    """
    platform, start = row[X_PLATFORM : X_PLATFORM + 8], row[X_START : X_START + 9]
    platform_at(future, step, contact, platform)
    si, ci = math.sin(platform[6]), math.cos(platform[6])
    thrust = max(e[E_THRUST_FLAT] * GRAVITY * ci, e[E_THRUST_STEEP])
    ch, sh = math.cos(platform[3]), math.sin(platform[3])
    natural, end = row[X_TARGET : X_TARGET + 3], row[X_TARGET + 3 : X_TARGET + 9]
    n = (-si * ch, -si * sh, ci)
    along = 0.0
    for k in range(3):
        board = platform[4] * ch if k == 0 else (platform[4] * sh if k == 1 else 0.0)
        end[k] = board - e[E_IMPACT] * n[k]
        end[3 + k] = thrust * n[k] - (GRAVITY if k == 2 else 0.0)
        mean, swing = 0.5 * (start[3 + k] + end[k]), (start[6 + k] - end[3 + k]) / 12.0
        natural[k] = start[k] + contact * mean + contact * contact * swing - platform[k]
        along += natural[k] * n[k]
    miss = 0.0
    for k in range(3):
        natural[k] -= along * n[k]
        miss += natural[k] * natural[k]
    free = min(1.0, max(0.0, (e[E_AIM] - contact) / (0.5 * e[E_AIM])))
    free *= min(1.0, e[E_MISS] / max(math.sqrt(miss), 1e-6))
    for k in range(3):
        p = platform[k] + 0.03 * n[k] + free * natural[k]
        poly.fit_axis(
            start[k], start[3 + k], start[6 + k], p, end[k], end[3 + k], contact, e[E_FLATTEN], row, X_TRY1 + k * _C
        )


@njit
def _cost(row, at, duration, offset, after, future, step, gain, drag, e, limit):
    """Cost of the motion at row[at:] over `duration`, from `offset` s from now until `after` s before contact.

    Stops early above `limit`.
    """
    motion, platform = row[at : at + _M], row[X_PLATFORM : X_PLATFORM + 8]
    low, high = e[E_LOW] * gain, e[E_HIGH] * gain
    rate = e[E_RATE_FLAT] + min(1.0, 2.0 * math.sin(future[0, 6])) * (e[E_RATE] - e[E_RATE_FLAT])
    cost, dt = 0.0, duration / _SAMPLES
    for k in range(1, _SAMPLES + 1):
        t = k * dt
        vx, vy, vz = poly.velocity(motion, 0, t), poly.velocity(motion, _C, t), poly.velocity(motion, 2 * _C, t)
        fx = poly.acceleration(motion, 0, t) + drag * vx
        fy = poly.acceleration(motion, _C, t) + drag * vy
        fz = poly.acceleration(motion, 2 * _C, t) + drag * vz + GRAVITY
        f = max(0.5, math.sqrt(fx * fx + fy * fy + fz * fz))
        zx, zy, zz = fx / f, fy / f, fz / f
        excess = max(0.0, low - f, f - high)
        cost += e[E_W_THRUST] * excess * excess * dt
        jx, jy, jz = poly.jerk(motion, 0, t), poly.jerk(motion, _C, t), poly.jerk(motion, 2 * _C, t)
        along = jx * zx + jy * zy + jz * zz
        turn = math.sqrt(max(0.0, jx * jx + jy * jy + jz * jz - along * along)) / f
        excess = max(0.0, turn - rate)
        cost += (e[E_W_RATE] * excess * excess + e[E_W_SMOOTH] * turn * turn) * dt
        excess = max(0.0, math.sqrt(vx * vx + vy * vy + vz * vz) - e[E_SPEED])
        cost += e[E_W_SPEED] * excess * excess * dt
        x, y, z = poly.position(motion, 0, t), poly.position(motion, _C, t), poly.position(motion, 2 * _C, t)
        short = max(0.0, _GROUND - z)
        cost += e[E_W_CLEARANCE] * short * short * dt
        left = after + duration - t
        if left > 1e-6:
            platform_at(future, step, offset + t, platform)
            dx, dy, dz = x - platform[0], y - platform[1], z - platform[2]
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            si, ci = math.sin(platform[6]), math.cos(platform[6])
            nx, ny, nz = -si * math.cos(platform[3]), -si * math.sin(platform[3]), ci
            height = nx * dx + ny * dy + nz * dz
            if distance < _REACH:
                cosine = nx * zx + ny * zy + nz * zz
                edge = 0.04 * cosine + 0.13 * math.sqrt(max(0.0, 1.0 - cosine * cosine))
                short = max(0.0, edge + 0.05 * min(1.0, left / 0.3) - height)
                cost += e[E_W_CLEARANCE] * short * short * dt
            if e[E_W_VIEW] > 0.0 and left > e[E_BLIND]:
                # Angle of the board below the body's x-y plane: the drone is taken to face the board.
                below = math.asin(min(1.0, max(-1.0, (dx * zx + dy * zy + dz * zz) / max(distance, 1e-6))))
                out = max(0.0, abs(below - _TILT) - _HALF_VIEW) + max(0.0, 0.2 - height / max(distance, 1e-6))
                cost += e[E_W_VIEW] * min(1.0, 5.0 * out) * dt
        if cost > limit:
            return cost
    return cost


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
            start[k], start[3 + k], start[6 + k], begin[k], begin[3 + k], 0.0, duration, 0.0, row, X_TRY1 + k * _C
        )
    cost = e[E_W_TIME] * contact + e[E_W_POSTPONE] * max(0.0, late)
    if cost < row[X_COST]:
        cost += _cost(row, X_TRY1, duration, 0.0, length, future, step, gain, drag, e, row[X_COST] - cost)
    if cost < row[X_COST]:
        cost += _cost(row, X_TRY2, length, duration, 0.0, future, step, gain, drag, e, row[X_COST] - cost)
    if cost < row[X_COST]:
        row[X_COST] = cost
        row[X_FIRST : X_FIRST + 2 * _M] = row[X_TRY1 : X_TRY1 + 2 * _M]
        row[X_BEGUN], row[X_MIDDLE], row[X_CONTACT] = t, t + duration, t + contact


@njit
def _try_end(row, t, contact, late, future, step, gain, drag, e):
    """Try to go straight to the board in `contact` s; keep it if it is the cheapest so far."""
    _fit_end(row, future, step, contact, e)
    cost = e[E_W_TIME] * contact + e[E_W_POSTPONE] * max(0.0, late)
    if cost < row[X_COST]:
        cost += _cost(row, X_TRY1, contact, 0.0, 0.0, future, step, gain, drag, e, row[X_COST] - cost)
    if cost < row[X_COST]:
        row[X_COST] = cost
        row[X_SECOND : X_SECOND + _M] = row[X_TRY1 : X_TRY1 + _M]
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
def _follow(row, t, vehicle, platform, gain, drag, e, planner, out):
    """CTBR that follows the plan at time `t`."""
    second = t >= row[X_MIDDLE]
    at = X_SECOND if second else X_FIRST
    motion = row[at : at + _M]
    end = row[X_CONTACT] if second else row[X_MIDDLE]
    begun = row[X_BEGUN] if not second or row[X_MIDDLE] <= row[X_BEGUN] else row[X_MIDDLE]
    duration = end - begun
    now, left = min(duration, t - begun), row[X_CONTACT] - t
    ahead, soon = min(duration, now + e[E_RATE_LAG]), min(duration, now + e[E_THRUST_LAG])
    fade = min(1.0, max(0.0, left / e[E_FADE]))
    p, v, q = vehicle[P : P + 3], vehicle[V : V + 3], vehicle[Q : Q + 4]
    x = row[X_START : X_START + 9]
    for k in range(3):
        gap = 10.0 * (poly.position(motion, k * _C, now) - p[k]) + 6.0 * (poly.velocity(motion, k * _C, now) - v[k])
        x[k] = fade * gap + drag * v[k] + (GRAVITY if k == 2 else 0.0)
    fx, fy, fz = (
        x[0] + poly.acceleration(motion, 0, now),
        x[1] + poly.acceleration(motion, _C, now),
        x[2] + poly.acceleration(motion, 2 * _C, now),
    )
    gx, gy, gz = (
        x[0] + poly.acceleration(motion, 0, ahead),
        x[1] + poly.acceleration(motion, _C, ahead),
        x[2] + poly.acceleration(motion, 2 * _C, ahead),
    )
    jx, jy, jz = poly.jerk(motion, 0, ahead), poly.jerk(motion, _C, ahead), poly.jerk(motion, 2 * _C, ahead)
    zx, zy, zz = body_z(q)
    thrust = (
        (x[0] + poly.acceleration(motion, 0, soon)) * zx
        + (x[1] + poly.acceleration(motion, _C, soon)) * zy
        + (x[2] + poly.acceleration(motion, 2 * _C, soon)) * zz
    )
    yaw_rate = face(q, p, platform, planner) if left > 0.4 else 0.0
    track_force(q, fx, fy, fz, gx, gy, gz, jx, jy, jz, yaw_rate, thrust, gain, planner, out)


@njit
def expert_step(rows, i, row, platform, future, step, gain, e, planner, out):
    """The expert's CTBR for episode i into `out` (4,): body rate rad/s, thrust m/s^2.

    `row` expert row; `platform` (8,) the board now, `future` (K, 8) the same `step` s apart from now, read when
    `expert_due`: the truth, or a belief; `gain` achieved over asked thrust; `e` row of ExpertParams; `planner` row of
    PlannerParams for the inner loop's gains.
    """
    vehicle, params, state = rows.vehicle[i], rows.params[i], rows.state[i]
    t = state[S_STEP] * TICK
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
    _follow(row, t, vehicle, platform, gain, drag, e, planner, out)


@njit
def expert_due(row, t):
    """True if this step will look at the whole future."""
    return t >= row[X_NEXT] - 1e-6
