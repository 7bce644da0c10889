"""The search for a perch: durations times terminal thrusts, each one closed-form motion, judged on samples.

A motion ends at (board + offset along its normal, v_board - impact_speed n, f z - g): on the board, at the contact
speed, with the body's z axis where thrust f points, which is the normal n but for a small lean up the slope.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from groundcar.motion.pose import board_normal
from kernel.clip import clip
from kernel.jit import njit
from policies.estimation import belief_state
from policies.planner import params_row as pp
from policies.planner import polynomial as poly
from policies.prediction.future import board_at
from vehicle.quadrotor.airframe import GRAVITY

SAMPLES = 14  # points at which a motion is judged
THRUSTS = 5  # terminal thrusts that are tried
_REACH = 0.6  # m, clearance over the board's plane is demanded only this near to the board
_GROUND = 0.35  # m, least height over the ground
_STEADY = 0.5  # m/s^2, predicted acceleration of a board of constant speed at most
_C = poly.COEFFICIENTS
MOTION_DIM = 3 * _C


@njit
def _drift(start, board, vx, vy, ax, ay, duration, params):
    """How far beside the board's centre (m, to its left) a perch in `duration` s may end.

    Late corrections across the board tilt the vehicle when it has to turn up, and the board is wide: the nearer contact
    is, the more the motion ends where the vehicle drifts anyway, by up to `Contact.miss`. `vx`..`ay`: the motion's end.
    """
    free = clip(2.0 - 2.0 * duration / max(params[pp.contact.aim], 1e-6), 0.0, 1.0)
    if free <= 0.0:
        return 0.0
    ch, sh = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    mean_x, mean_y = 0.5 * duration * (start[3] + vx), 0.5 * duration * (start[4] + vy)
    bend = duration * duration / 12.0
    dx = start[0] + mean_x + bend * (start[6] - ax) - board[board_row.X]
    dy = start[1] + mean_y + bend * (start[7] - ay) - board[board_row.Y]
    return free * clip(dy * ch - dx * sh, -params[pp.contact.miss], params[pp.contact.miss])


@njit
def fit_perch(start, board, duration, thrust, skid, params, motion):
    """Fit `motion` ((MOTION_DIM,)) from `start` ((9,): position, velocity, acceleration) to the board at contact.

    `board` (8,): the board at contact (policies.estimation.belief_state), its acceleration included. `thrust` (m/s^2)
    and `skid` (m/s, up the slope, relative to the board) at contact.
    """
    nx, ny, nz = board_normal(board)
    offset = (
        params[pp.vehicle.contact_below]
        - params[pp.contact.overshoot]
        - params[pp.contact.overshoot_by_acceleration] * max(0.0, abs(board[belief_state.ACCELERATION]) - _STEADY)
    )
    into, flat = params[pp.contact.speed], params[pp.contact.flatten] * max(0.0, 2.0 * nz - 1.0)
    ch, sh = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    vx = (board[board_row.SPEED] + skid * nz) * ch - into * nx
    vy = (board[board_row.SPEED] + skid * nz) * sh - into * ny
    vz = skid * math.sin(board[board_row.INCLINATION]) - into * nz
    drag = params[pp.vehicle.drag]
    lean = params[pp.contact.lean] * min(1.0, 2.0 * math.sin(board[board_row.INCLINATION]))
    cl, sl = math.cos(lean), math.sin(lean)
    zx, zy, zz = nx * cl + nz * ch * sl, ny * cl + nz * sh * sl, nz * cl + math.sin(board[board_row.INCLINATION]) * sl
    fx, fy, fz = thrust * zx - drag * vx, thrust * zy - drag * vy, thrust * zz - drag * vz - GRAVITY
    aside = _drift(start, board, vx, vy, fx, fy, duration, params)
    x, y = board[board_row.X] + offset * nx - aside * sh, board[board_row.Y] + offset * ny + aside * ch
    poly.fit_axis(start[0], start[3], start[6], x, vx, fx, duration, flat, motion, 0)
    poly.fit_axis(start[1], start[4], start[7], y, vy, fy, duration, flat, motion, _C)
    poly.fit_axis(
        start[2], start[5], start[8], board[board_row.Z] + offset * nz, vz, fz, duration, flat, motion, 2 * _C
    )


@njit
def motion_cost(motion, duration, future, step, offset, low, high, params, limit, board):
    """Cost of a motion on SAMPLES points; stops early above `limit`. `offset` s: of the motion's start in `future`.

    `low`, `high`: thrust the vehicle can really give, m/s^2. `board` (8,) is scratch.
    """
    g, drag = GRAVITY, params[pp.vehicle.drag]
    cost, gap = 0.0, 0.0
    dt = duration / SAMPLES
    for k in range(1, SAMPLES + 1):
        t = k * dt
        left = duration - t
        vx, vy, vz = poly.velocity(motion, 0, t), poly.velocity(motion, _C, t), poly.velocity(motion, 2 * _C, t)
        fx = poly.acceleration(motion, 0, t) + drag * vx
        fy = poly.acceleration(motion, _C, t) + drag * vy
        fz = poly.acceleration(motion, 2 * _C, t) + drag * vz + g
        f = max(0.5, math.sqrt(fx * fx + fy * fy + fz * fz))
        zx, zy, zz = fx / f, fy / f, fz / f
        excess = max(0.0, low - f, f - high)
        cost += params[pp.weights.thrust] * excess * excess * dt
        jx, jy, jz = poly.jerk(motion, 0, t), poly.jerk(motion, _C, t), poly.jerk(motion, 2 * _C, t)
        along = jx * zx + jy * zy + jz * zz
        rate = math.sqrt(max(0.0, jx * jx + jy * jy + jz * jz - along * along)) / f
        excess = max(0.0, rate - 0.9 * params[pp.vehicle.rate_max])
        cost += params[pp.weights.rate] * excess * excess * dt
        excess = max(0.0, math.sqrt(vx * vx + vy * vy + vz * vz) - params[pp.search.speed_max])
        cost += params[pp.weights.speed] * excess * excess * dt
        if k < SAMPLES:
            x, y, z = poly.position(motion, 0, t), poly.position(motion, _C, t), poly.position(motion, 2 * _C, t)
            board_at(future, step, offset + t, board)
            nx, ny, nz = board_normal(board)
            dx, dy, dz = x - board[board_row.X], y - board[board_row.Y], z - board[board_row.Z]
            cosine = nx * zx + ny * zy + nz * zz
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            height = nx * dx + ny * dy + nz * dz
            if distance < _REACH:
                edge = params[pp.vehicle.contact_below] * cosine + params[pp.vehicle.contact_radius] * math.sqrt(
                    max(0.0, 1.0 - cosine * cosine)
                )
                short = max(0.0, edge + 0.05 * min(1.0, left / 0.3) - height)
                cost += params[pp.weights.clearance] * short * short * dt
            short = max(0.0, _GROUND - z)
            cost += params[pp.weights.clearance] * short * short * dt
            if left > params[pp.search.blind]:
                # Angle of the board below the body's x-y plane, if the vehicle faces the board.
                below = math.asin(clip((dx * zx + dy * zy + dz * zz) / max(distance, 1e-6), -1.0, 1.0))
                out = max(0.0, abs(below - params[pp.vehicle.camera_tilt]) - params[pp.search.half_view])
                facing = max(0.0, 0.2 - height / max(distance, 1e-6))
                # A gap in the view costs with its square: the board's motion meanwhile has to be corrected at once.
                unseen = min(1.0, 10.0 * out + 10.0 * facing)
                gap = unseen * (gap + dt)
                cost += 2.0 * params[pp.weights.visibility] * gap * dt
        if cost > limit:
            return cost
    return cost


@njit
def search(
    start, future, step, offset, gain, shortest, longest, durations, remaining, params, best, scratch, target, board
):
    """The cheapest perch from `start` with a duration in [shortest, longest] s; fills `best` ((MOTION_DIM,)).

    `offset` s: of the motion's start from `future`'s first row; `gain`: achieved over commanded thrust;
    `remaining` s of the plan under way (0: none), whose postponement costs. `scratch` (MOTION_DIM,), `target` and
    `board` (8,) are overwritten.
    Returns (cost, duration, terminal thrust); cost is infinite if nothing finite was found.
    """
    low, high = params[pp.vehicle.thrust_min] * gain + 0.2, 0.95 * params[pp.vehicle.thrust_max] * gain
    least, found, found_thrust = math.inf, 0.0, 0.0
    span = (longest - shortest) / max(1, durations - 1)
    for i in range(durations):
        duration = shortest + span * i
        base = params[pp.weights.time] * duration
        if remaining > 0.0:
            base += params[pp.weights.postpone] * max(0.0, duration - remaining)
        if base >= least:
            continue
        board_at(future, step, offset + duration + step, board)
        board_at(future, step, offset + duration, target)
        target[belief_state.ACCELERATION] = (board[board_row.SPEED] - target[board_row.SPEED]) / step
        for j in range(2 * THRUSTS):
            thrust = params[pp.search.thrust_min] + (params[pp.search.thrust_max] - params[pp.search.thrust_min]) * (
                j // 2
            ) / (THRUSTS - 1)
            skid = params[pp.contact.skid] if j % 2 == 1 else 0.0
            extra = (
                base
                + 0.3 * max(0.0, low + 0.3 - thrust)
                + params[pp.weights.force] * thrust
                + params[pp.weights.skid] * skid * skid
            )
            if extra >= least or (j % 2 == 1 and skid == 0.0):
                continue
            fit_perch(start, target, duration, thrust, skid, params, scratch)
            cost = extra + motion_cost(scratch, duration, future, step, offset, low, high, params, least - extra, board)
            if cost < least:
                least, found, found_thrust = cost, duration, thrust
                best[:] = scratch
    return least, found, found_thrust
