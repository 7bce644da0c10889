"""What a motion costs the expert: limits of thrust and body rate, speed, clearance of ground and board, sight."""

from __future__ import annotations

import math

from kernel.jit import njit
from policies.planner import polynomial as poly
from policies.prediction.future import board_at
from policies.teachers.params import (
    AXIS,
    E_BLIND,
    E_HIGH,
    E_LOW,
    E_RATE,
    E_RATE_FLAT,
    E_SPEED,
    E_W_CLEARANCE,
    E_W_RATE,
    E_W_SMOOTH,
    E_W_SPEED,
    E_W_THRUST,
    E_W_VIEW,
    MOTION,
    X_BOARD,
)
from vehicle.quadrotor.airframe import GRAVITY

_SAMPLES = 12
_REACH = 0.6  # m, clearance over the board's plane is asked only this near to the board
_GROUND = 0.35  # m
_TILT, _HALF_VIEW = math.radians(15.0), math.radians(22.0)  # camera below body x, half its vertical field of view


@njit
def motion_cost(row, at, duration, offset, after, future, step, gain, drag, e, limit):
    """Cost of the motion at row[at:] over `duration`, from `offset` s from now until `after` s before contact.

    Stops early above `limit`.
    """
    motion, board = row[at : at + MOTION], row[X_BOARD : X_BOARD + 8]
    low, high = e[E_LOW] * gain, e[E_HIGH] * gain
    rate = e[E_RATE_FLAT] + min(1.0, 2.0 * math.sin(future[0, 6])) * (e[E_RATE] - e[E_RATE_FLAT])
    cost, dt = 0.0, duration / _SAMPLES
    for k in range(1, _SAMPLES + 1):
        t = k * dt
        vx, vy, vz = poly.velocity(motion, 0, t), poly.velocity(motion, AXIS, t), poly.velocity(motion, 2 * AXIS, t)
        fx = poly.acceleration(motion, 0, t) + drag * vx
        fy = poly.acceleration(motion, AXIS, t) + drag * vy
        fz = poly.acceleration(motion, 2 * AXIS, t) + drag * vz + GRAVITY
        f = max(0.5, math.sqrt(fx * fx + fy * fy + fz * fz))
        zx, zy, zz = fx / f, fy / f, fz / f
        excess = max(0.0, low - f, f - high)
        cost += e[E_W_THRUST] * excess * excess * dt
        jx, jy, jz = poly.jerk(motion, 0, t), poly.jerk(motion, AXIS, t), poly.jerk(motion, 2 * AXIS, t)
        along = jx * zx + jy * zy + jz * zz
        turn = math.sqrt(max(0.0, jx * jx + jy * jy + jz * jz - along * along)) / f
        excess = max(0.0, turn - rate)
        cost += (e[E_W_RATE] * excess * excess + e[E_W_SMOOTH] * turn * turn) * dt
        excess = max(0.0, math.sqrt(vx * vx + vy * vy + vz * vz) - e[E_SPEED])
        cost += e[E_W_SPEED] * excess * excess * dt
        x, y, z = poly.position(motion, 0, t), poly.position(motion, AXIS, t), poly.position(motion, 2 * AXIS, t)
        short = max(0.0, _GROUND - z)
        cost += e[E_W_CLEARANCE] * short * short * dt
        left = after + duration - t
        if left > 1e-6:
            board_at(future, step, offset + t, board)
            dx, dy, dz = x - board[0], y - board[1], z - board[2]
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            si, ci = math.sin(board[6]), math.cos(board[6])
            nx, ny, nz = -si * math.cos(board[3]), -si * math.sin(board[3]), ci
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
