"""Where the board is, from a board row (8,): R_world_board = Rz(heading) Ry(-inclination), normal backward, up."""

from __future__ import annotations

import math

from groundcar.motion.board_motion import HEADING, INCLINATION, SPEED, X, Y, Z
from kernel.jit import njit


@njit
def board_position(row):
    """Board centre (3 floats, m, world)."""
    return row[X], row[Y], row[Z]


@njit
def board_velocity(row):
    """Velocity of the board centre (3 floats, m/s, world): along the heading."""
    return row[SPEED] * math.cos(row[HEADING]), row[SPEED] * math.sin(row[HEADING]), 0.0


@njit
def board_normal(row):
    """Outward normal (3 floats, world): the board frame's z axis."""
    s = math.sin(row[INCLINATION])
    return -s * math.cos(row[HEADING]), -s * math.sin(row[HEADING]), math.cos(row[INCLINATION])


@njit
def board_axes(row):
    """The board frame's axes in the world (9 floats): x up-slope, y left, z normal, one after the other."""
    c, s = math.cos(row[INCLINATION]), math.sin(row[INCLINATION])
    ch, sh = math.cos(row[HEADING]), math.sin(row[HEADING])
    return c * ch, c * sh, s, -sh, ch, 0.0, -s * ch, -s * sh, c


@njit
def board_quaternion(row):
    """World from board as a quaternion w, x, y, z (4 floats)."""
    ch, sh = math.cos(0.5 * row[HEADING]), math.sin(0.5 * row[HEADING])
    ci, si = math.cos(0.5 * row[INCLINATION]), math.sin(0.5 * row[INCLINATION])
    return ch * ci, sh * si, -ch * si, sh * ci
