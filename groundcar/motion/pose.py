"""The board's pose and velocity from a board row (8,): R_world_board = Rz(heading) Ry(-inclination)."""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.jit import njit


@njit
def board_position(row):
    """Board centre (3 floats, m, world)."""
    return row[board_row.X], row[board_row.Y], row[board_row.Z]


@njit
def board_velocity(row):
    """Velocity of the board centre (3 floats, m/s, world): along the heading."""
    return (
        row[board_row.SPEED] * math.cos(row[board_row.HEADING]),
        row[board_row.SPEED] * math.sin(row[board_row.HEADING]),
        0.0,
    )


@njit
def board_normal(row):
    """Outward normal (3 floats, world): the board frame's z axis."""
    s = math.sin(row[board_row.INCLINATION])
    return (
        -s * math.cos(row[board_row.HEADING]),
        -s * math.sin(row[board_row.HEADING]),
        math.cos(row[board_row.INCLINATION]),
    )


@njit
def board_quaternion(row):
    """World from board as a quaternion w, x, y, z (4 floats)."""
    ch, sh = math.cos(0.5 * row[board_row.HEADING]), math.sin(0.5 * row[board_row.HEADING])
    ci, si = math.cos(0.5 * row[board_row.INCLINATION]), math.sin(0.5 * row[board_row.INCLINATION])
    return ch * ci, sh * si, -ch * si, sh * ci
