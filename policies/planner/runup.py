"""The run-up: the accelerated approach to a steep board, relative to it, that ends where the flare begins.

On a steep board the vehicle ends nose-up, and during that turn its thrust brakes it by several m/s: it has to arrive
fast. Backward in time from contact: a flare of constant thrust and body rate; before it a level coast in which the
camera sees the board again; before that an acceleration small enough to keep the camera's pitch, from a standoff at
rest. The run-up is flown on the present belief alone; only the last second has to be planned on a prediction.

Everything is in the vertical plane of the board's heading: x forward, z up, from the board's centre, moving with it.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.clip import clip
from kernel.jit import njit
from policies.planner import params_row as pp
from policies.planner.follow import command_acceleration, face, keep_in_view
from policies.prediction.speed_history import history_range
from vehicle.quadrotor.airframe import GRAVITY

_LOOK_DOWN = math.radians(33.7)  # below the horizon: the camera still sees the board at the start of the run-up
_SLOW, _FAST = 0.5, 1.75  # m/s, speeds between which a board goes from slow to not slow
_STEADY = 0.3  # m/s, range of speeds below which no moment is better than another


@njit
def runs_up(board, params):
    """True for a board so steep for its speed that it takes a run-up: a slow one can be met from any side."""
    slow = clip(1.0 - (abs(board[board_row.SPEED]) - _SLOW) / (_FAST - _SLOW), 0.0, 1.0)
    return board[board_row.INCLINATION] >= params[pp.run_up.inclination] + params[pp.run_up.inclination_slow] * slow


@njit
def flare_start(inclination, params):
    """Where and how fast the flare begins, relative to the board: (x m, z m, vx m/s, vz m/s, its duration s)."""
    f, w, g, into = params[pp.run_up.thrust], params[pp.run_up.rate], GRAVITY, params[pp.contact.speed]
    s, c = math.sin(inclination), math.cos(inclination)
    t = inclination / w
    vx1, vz1, offset = into * s, -into * c, params[pp.vehicle.contact_below]
    vx = vx1 + f / w * (1.0 - c)
    vz = vz1 - f / w * s + g * t
    x = -offset * s - vx1 * t - f / w * (s / w - t * c)
    z = offset * c - vz1 * t + f / w * (t * s - (1.0 - c) / w) - 0.5 * g * t * t
    return x, z, vx, vz, t


@njit
def runup_time(inclination, params):
    """Seconds from the standoff to the start of the flare."""
    return params[pp.run_up.coast] + flare_start(inclination, params)[2] / params[pp.run_up.acceleration]


@njit
def _rise(inclination, params):
    """Vertical acceleration (m/s^2) of the run-up: it begins high, but only as high as the camera can look down from.

    At its end the nose is down by as much as the camera's half field of view: a board that is not far enough below
    leaves the picture by its upper edge.
    """
    x, z, vx, vz, _ = flare_start(inclination, params)
    time = runup_time(inclination, params)
    away = vx * time - 0.5 * vx * vx / params[pp.run_up.acceleration] - x
    seen = 2.0 * (away * math.tan(_LOOK_DOWN) - z + vz * time) / (time * time)
    return clip(seen, 0.0, params[pp.run_up.rise])


@njit
def met_slow(future, step, inclination, share, history, params):
    """True if a run-up begun now meets the board in the lowest `share` of its past and predicted speeds.

    A fast board is harder: the flare begins faster, the camera is pitched away from the board for longer, and an error
    in the time of contact is a larger error along the board. A board of nearly constant speed is not waited for.
    `future` (K, 8) from now on, `history` a speed history row.
    """
    ahead = (runup_time(inclination, params) + flare_start(inclination, params)[4]) / step
    least, most = history_range(history)
    for k in range(future.shape[0]):
        least, most = min(least, abs(future[k, board_row.SPEED])), max(most, abs(future[k, board_row.SPEED]))
    then = abs(future[min(future.shape[0] - 1, int(ahead + 0.5)), board_row.SPEED])
    return most - least < _STEADY or then <= least + share * (most - least)


@njit
def runup_reference(left, inclination, params):
    """(x, z, vx, vz, ax, az) relative to the board, `left` s before the flare (negative: coasting on)."""
    x, z, vx, vz, _ = flare_start(inclination, params)
    az, ax = _rise(inclination, params), 0.0
    z, vz = z - vz * left + 0.5 * az * left * left, vz - az * left
    x -= vx * left
    if left > params[pp.run_up.coast]:
        ax = params[pp.run_up.acceleration]
        since = min(left - params[pp.run_up.coast], vx / ax)
        x += 0.5 * ax * since * since + vx * (left - params[pp.run_up.coast] - since)
        vx -= ax * since
    return x, z, vx, vz, ax, az


@njit
def fly_runup(left, resting, p, v, q, board, acceleration, gain, params, out):
    """Track the run-up, or with `resting` its starting point; fills `out` (4,). Returns position and speed error.

    `left` s to the flare; `acceleration` m/s^2 of the board now.
    """
    x, z, ux, uz, ax, az = runup_reference(left, board[board_row.INCLINATION], params)
    if resting:
        ux = uz = ax = az = 0.0
    c, s = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    speed, turn = board[board_row.SPEED], board[board_row.TURN_RATE]
    # The reference turns with the board, so its far end moves sideways.
    wx, wy = (speed + ux) * c - turn * x * s, (speed + ux) * s + turn * x * c
    ex, ey, ez = board[board_row.X] + x * c - p[0], board[board_row.Y] + x * s - p[1], board[board_row.Z] + z - p[2]
    dx, dy, dz = wx - v[0], wy - v[1], uz - v[2]
    kp, kv = params[pp.run_up.kp], params[pp.run_up.kv]
    error, rate = math.sqrt(ex * ex + ey * ey + ez * ez), math.sqrt(dx * dx + dy * dy + dz * dz)
    pull = kp / kv
    if resting:
        pull = min(params[pp.run_up.pull], params[pp.follow.speed] / max(error, 1e-6))
    forward, side = ax + acceleration - turn * turn * x, turn * (speed + 2.0 * ux)
    bx = forward * c - side * s + kv * (dx + pull * ex)
    by = forward * s + side * c + kv * (dy + pull * ey)
    bz = az + kv * (dz + pull * ez)
    tilt = params[pp.follow.tilt]
    if resting:
        bx, by = keep_in_view(bx, by, p, board, params)
    yaw_rate = face(q, p, board, params) + turn
    command_acceleration(q, v[0], v[1], v[2], bx, by, bz, yaw_rate, tilt, gain, params, out)
    return error, rate
