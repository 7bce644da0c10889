"""Flight without a plan: hovering, keeping station where the camera sees the board, climbing away from a miss."""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.clip import clip
from kernel.jit import njit
from kernel.rotations import body_z
from policies.planner import params_row as pp
from policies.planner.tracking import track_force, yaw_error
from vehicle.quadrotor.airframe import GRAVITY

_CLIMB = 3.0  # m/s^2, largest vertical acceleration while following
_RESCUE = 6.0  # m/s^2, the same after a miss: the vehicle leaves a steep board nose-up and sinking
_PITCH_LEAST, _PITCH_MARGIN = math.radians(9.0), math.radians(3.0)
_STEEP = math.radians(60.0)  # from this inclination on the standoff is that of steep boards


@njit
def command_acceleration(q, vx, vy, vz, ax, ay, az, yaw_rate, tilt, gain, params, out, climb=_CLIMB):
    """CTBR into `out` (4,) for an acceleration (world, m/s^2) cut at `tilt` rad and, vertically, at `climb` m/s^2."""
    most = GRAVITY * math.tan(tilt)
    level = math.sqrt(ax * ax + ay * ay)
    if level > most:
        ax, ay = ax * most / level, ay * most / level
    az = clip(az, -climb, climb)
    fx, fy, fz = (
        ax + params[pp.vehicle.drag] * vx,
        ay + params[pp.vehicle.drag] * vy,
        az + params[pp.vehicle.drag] * vz + GRAVITY,
    )
    zx, zy, zz = body_z(q)
    thrust = fx * zx + fy * zy + fz * zz
    track_force(q, fx, fy, fz, fx, fy, fz, 0.0, 0.0, 0.0, yaw_rate, thrust, gain, params, out)


@njit
def face(q, p, board, params):
    """Yaw rate (rad/s) that turns the camera to the board; 0 where the board is too near for a bearing."""
    dx, dy = board[board_row.X] - p[0], board[board_row.Y] - p[1]
    near = math.sqrt(dx * dx + dy * dy) / max(params[pp.follow.yaw_near], 1e-6) - 1.0
    if near <= 0.0:
        return 0.0
    rate = params[pp.follow.yaw_k] * yaw_error(q, dx, dy) * min(1.0, near)
    return clip(rate, -params[pp.follow.yaw_rate_max], params[pp.follow.yaw_rate_max])


@njit
def hold(q, v, climb, gain, params, out):
    """Come to rest, climbing at `climb` m/s."""
    k = 1.5
    command_acceleration(
        q, v[0], v[1], v[2], -k * v[0], -k * v[1], k * (climb - v[2]), 0.0, params[pp.follow.tilt], gain, params, out
    )


@njit
def keep_in_view(ax, ay, p, board, params):
    """Limit a horizontal acceleration (2 floats) along the bearing of the board, so that the board stays in view.

    Accelerating towards the board pitches the camera down, away from it the camera up: each by no more than the board's
    depression leaves room for, and by no less than _PITCH_LEAST.
    """
    dx, dy, dz = board[board_row.X] - p[0], board[board_row.Y] - p[1], p[2] - board[board_row.Z]
    level = max(1e-3, math.sqrt(dx * dx + dy * dy))
    dx, dy = dx / level, dy / level
    below, room = math.atan2(dz, level), params[pp.search.half_view] - _PITCH_MARGIN
    forward = max(_PITCH_LEAST, below - params[pp.vehicle.camera_tilt] + room)
    backward = max(_PITCH_LEAST, params[pp.vehicle.camera_tilt] + room - below)
    along = ax * dx + ay * dy
    g = GRAVITY
    kept = clip(along, -g * math.tan(min(backward, 1.0)), g * math.tan(min(forward, 1.0)))
    return ax + (kept - along) * dx, ay + (kept - along) * dy


@njit
def follow(p, v, q, board, extra, gain, params, out):
    """Fly to the standoff behind and above the board and match its motion; `extra` m is added to the distance."""
    steep = clip(board[board_row.INCLINATION] / _STEEP, 0.0, 1.0)
    away = (
        params[pp.follow.distance_flat] + steep * (params[pp.follow.distance] - params[pp.follow.distance_flat]) + extra
    )
    up = params[pp.follow.elevation_flat] + steep * (params[pp.follow.elevation] - params[pp.follow.elevation_flat])
    c, s = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    back = away * math.cos(up)
    speed, turn = board[board_row.SPEED], board[board_row.TURN_RATE]
    # The standoff is fixed to the board, so it moves sideways when the board turns.
    wx, wy = speed * c + turn * back * s, speed * s - turn * back * c
    ex, ey = board[board_row.X] - back * c - p[0], board[board_row.Y] - back * s - p[1]
    ez = board[board_row.Z] + away * math.sin(up) - p[2]
    kp = params[pp.follow.kp]
    gap = math.sqrt(ex * ex + ey * ey)
    slow = min(1.0, params[pp.follow.speed] / max(kp * gap, 1e-6))
    ux, uy, uz = wx + kp * slow * ex, wy + kp * slow * ey, clip(kp * ez, -1.5, 1.5)
    kv = params[pp.follow.kv]
    ax, ay = kv * (ux - v[0]) - turn * speed * s, kv * (uy - v[1]) + turn * speed * c
    ax, ay = keep_in_view(ax, ay, p, board, params)
    tilt = params[pp.follow.tilt]
    yaw_rate = face(q, p, board, params) + turn
    command_acceleration(q, v[0], v[1], v[2], ax, ay, kv * (uz - v[2]), yaw_rate, tilt, gain, params, out)


@njit
def climb_away(p, v, q, board, gain, params, out):
    """Leave the board upward and backward after a missed contact."""
    c, s = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    vx, vy = board[board_row.SPEED] * c - 1.2 * c, board[board_row.SPEED] * s - 1.2 * s
    k = 3.0
    yaw_rate = face(q, p, board, params)
    command_acceleration(
        q, v[0], v[1], v[2], k * (vx - v[0]), k * (vy - v[1]), k * (1.2 - v[2]), yaw_rate, 0.6, gain, params, out,
        _RESCUE,
    )  # fmt: skip
