"""Cost of a motion for the expert: limits of thrust and body rate, speed, clearance of ground and board, view."""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.jit import njit
from policies.planner import params_row as pp
from policies.planner import polynomial as poly
from policies.prediction.future import board_at
from policies.teachers import expert_row
from policies.teachers.params import AT
from vehicle.quadrotor.airframe import GRAVITY

_SAMPLES = 12
_REACH = 0.6  # m, clearance over the board's plane is demanded only this near to the board
_GROUND = 0.35  # m
_HALF_VIEW = math.radians(22.0)  # half of the vertical field of view in which the board shall be


@njit
def motion_cost(row, at, duration, offset, after, future, step, gain, drag, e, planner, limit):
    """Cost of the motion at row[at:] over `duration`, from `offset` s from now until `after` s before contact.

    `e` row of ExpertParams; `planner` row of PlannerParams for the vehicle. Stops early above `limit`.
    """
    motion, board = row[at : at + expert_row.MOTION], row[expert_row.BOARD : expert_row.BOARD + board_row.DIM]
    low, high = e[AT.low] * gain, e[AT.high] * gain
    below, radius = planner[pp.vehicle.contact_below], planner[pp.vehicle.contact_radius]
    cost, dt = 0.0, duration / _SAMPLES
    for k in range(1, _SAMPLES + 1):
        t = k * dt
        vx, vy, vz = (
            poly.velocity(motion, 0, t),
            poly.velocity(motion, expert_row.AXIS, t),
            poly.velocity(motion, 2 * expert_row.AXIS, t),
        )
        fx = poly.acceleration(motion, 0, t) + drag * vx
        fy = poly.acceleration(motion, expert_row.AXIS, t) + drag * vy
        fz = poly.acceleration(motion, 2 * expert_row.AXIS, t) + drag * vz + GRAVITY
        f = max(0.5, math.sqrt(fx * fx + fy * fy + fz * fz))
        zx, zy, zz = fx / f, fy / f, fz / f
        excess = max(0.0, low - f, f - high)
        cost += e[AT.w_thrust] * excess * excess * dt
        jx, jy, jz = (
            poly.jerk(motion, 0, t),
            poly.jerk(motion, expert_row.AXIS, t),
            poly.jerk(motion, 2 * expert_row.AXIS, t),
        )
        along = jx * zx + jy * zy + jz * zz
        turn = math.sqrt(max(0.0, jx * jx + jy * jy + jz * jz - along * along)) / f
        excess = max(0.0, turn - e[AT.rate])
        cost += (e[AT.w_rate] * excess * excess + e[AT.w_smooth] * turn * turn) * dt
        excess = max(0.0, math.sqrt(vx * vx + vy * vy + vz * vz) - e[AT.speed])
        cost += e[AT.w_speed] * excess * excess * dt
        x, y, z = (
            poly.position(motion, 0, t),
            poly.position(motion, expert_row.AXIS, t),
            poly.position(motion, 2 * expert_row.AXIS, t),
        )
        short = max(0.0, _GROUND - z)
        cost += e[AT.w_clearance] * short * short * dt
        left = after + duration - t
        if left > 1e-6:
            board_at(future, step, offset + t, board)
            dx, dy, dz = x - board[board_row.X], y - board[board_row.Y], z - board[board_row.Z]
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            si, ci = math.sin(board[board_row.INCLINATION]), math.cos(board[board_row.INCLINATION])
            nx, ny, nz = -si * math.cos(board[board_row.HEADING]), -si * math.sin(board[board_row.HEADING]), ci
            height = nx * dx + ny * dy + nz * dz
            if distance < _REACH:
                cosine = nx * zx + ny * zy + nz * zz
                edge = below * cosine + radius * math.sqrt(max(0.0, 1.0 - cosine * cosine))
                short = max(0.0, edge + 0.05 * min(1.0, left / 0.3) - height)
                cost += e[AT.w_clearance] * short * short * dt
            if e[AT.w_view] > 0.0 and left > e[AT.blind]:
                # Angle of the board below the body's x-y plane, if the vehicle faces the board.
                depression = math.asin(min(1.0, max(-1.0, (dx * zx + dy * zy + dz * zz) / max(distance, 1e-6))))
                out = max(0.0, abs(depression - planner[pp.vehicle.camera_tilt]) - _HALF_VIEW) + max(
                    0.0, 0.2 - height / max(distance, 1e-6)
                )
                cost += e[AT.w_view] * min(1.0, 5.0 * out) * dt
        if cost > limit:
            return cost
    return cost
