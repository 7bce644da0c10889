"""The approach to the board: the quantities in the conditions of the laws of guidance."""

from __future__ import annotations

import math

from groundcar.motion import board_row
from groundcar.motion.pose import board_normal
from kernel.jit import njit


@njit
def approach(p, v, zx, zy, zz, board, below, radius):
    """How the underside's disc nears the board: height of its lowest point over the board's plane (m), closing speed of
    the vehicle's centre (m/s), cosine between body z and normal, squared distance of the centre from the normal (m^2).

    `below`, `radius`: the disc of the contact criterion, m; `p`, `v` (3,) world;
    (zx, zy, zz) body z; `board` (8,) the board now.
    """
    nx, ny, nz = board_normal(board)
    c, s = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    dx, dy, dz = p[0] - board[board_row.X], p[1] - board[board_row.Y], p[2] - board[board_row.Z]
    cosine = nx * zx + ny * zy + nz * zz
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    centre = nx * dx + ny * dy + nz * dz
    closing = -(nx * (v[0] - board[board_row.SPEED] * c) + ny * (v[1] - board[board_row.SPEED] * s) + nz * v[2])
    return centre - below * cosine - radius * sine, closing, cosine, dx * dx + dy * dy + dz * dz - centre * centre
