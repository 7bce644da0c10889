"""The last eighth of a second: body rates that let the drone touch aligned, whatever flew it there.

A network that has learnt from a planner misses by its attitude where it has speed along the board to spare. So the
misalignment at contact is foretold from the rates now asked, and what exceeds a band is taken off them. Inside the band
nothing changes. Over steep boards the band lies about a lean up the slope: thrust then holds against the pull along it,
and a contact too early or too late skids less. On a board that turns hard it lies about a bank into the turn: a drone
levelled too early drifts out of it.

The planner calls this kernel; `network_touch.py` says the same in torch, so that an exported network carries it.
"""

from __future__ import annotations

import math

from groundcar.motion.pose import board_normal
from kernel.jit import njit
from kernel.rotations import body_z, rotate_back
from policies.guidance.approach import approach
from vehicle.quadrotor.airframe import GRAVITY

FROM = 0.12  # s to contact, from where on
SHORTEST = 0.08  # s in which an excess is at most to be turned away; less rattles
UNSURE, MOST = 3.0, 0.04  # the surface may be nearer by so many of its sigmas, at most by m
LAG = 0.04  # s that the rates asked before still act
BAND = 0.08  # rad about the wanted axis
BESIDE = 0.3  # m from the board's centre along its surface
SLOWEST = 0.1  # m/s towards the board
FACING = 0.5  # cosine between body z and normal
BANK, BANK_FROM, BANK_MOST = 0.4, 0.18, 0.04  # share of the bank that a turn takes beyond rad, at most rad


@njit
def wanted_axis(board, left, lean):
    """Where body z is wanted in `left` s (3 floats, not normalised): on the normal of then, but for lean and bank.

    `board` (8,) the board now; `lean` rad up a vertical slope, less up others.
    """
    nx, ny, nz = board_normal(board)
    c, s, sine = math.cos(board[3]), math.sin(board[3]), math.sin(board[6])
    turn, lean = board[5] * left, lean * sine
    pull = board[4] * board[5] / GRAVITY
    bank = math.copysign(min(BANK_MOST, BANK * max(0.0, abs(pull) - BANK_FROM)), pull)
    wx = nx - turn * ny + lean * nz * c - bank * s
    wy = ny + turn * nx + lean * nz * s + bank * c
    return wx, wy, nz + lean * sine


@njit
def touch_rates(p, v, q, board, before, sigma, lean, below, radius, limit, out):
    """Correct the roll and pitch rate of `out` ((4,): body rate FLU rad/s, thrust) for an aligned contact.

    `p`, `v` (3,) world, `q` (4,) world from body; `board` (8,) the board now; `before` (2,) rates asked a step
    earlier, rad/s; `sigma` m of the board's surface along its normal; `lean`: rad that the wanted axis leans up a
    vertical slope, less up others; `below`, `radius` the disc of the contact criterion, m; `limit` of the rates, rad/s.
    """
    zx, zy, zz = body_z(q)
    height, closing, cosine, beside = approach(p, v, zx, zy, zz, board, below, radius)
    if closing < SLOWEST or cosine < FACING or beside > BESIDE * BESIDE:
        return
    left = (height - min(MOST, UNSURE * sigma)) / closing
    if left > FROM:
        return
    left = max(0.0, left)
    wx, wy, wz = wanted_axis(board, left, lean)
    off = rotate_back(q, zy * wz - zz * wy, zz * wx - zx * wz, zx * wy - zy * wx)
    span = max(SHORTEST, left - LAG)
    for axis in range(2):
        then = off[axis] - before[axis] * LAG - out[axis] * span
        rate = out[axis] + (then - min(BAND, max(-BAND, then))) / span
        out[axis] = min(limit, max(-limit, rate))
