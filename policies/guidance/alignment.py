"""Terminal attitude alignment: body rates that bring body z onto the board's normal at contact.

The misalignment at contact is predicted from the body rates now asked, and what exceeds a band is taken off them.
Inside the band nothing changes. Over inclined boards the band lies about a lean up the slope: thrust then opposes the
component of gravity along it, and a contact too early or too late slides less. On a board that turns hard the band lies
about a bank into the turn: a vehicle levelled too early drifts out of the turn.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from groundcar.motion.pose import board_normal
from kernel.clip import clip, command_within
from kernel.jit import njit
from kernel.rotations import body_z, rotate_back
from policies.guidance import params as gp
from policies.guidance.approach import approach
from vehicle.quadrotor.airframe import GRAVITY


@njit
def lean_now(board, sigma, g):
    """Lean of the wanted axis, rad up a vertical slope, for a surface known to `sigma` m. `board` (8,), `g` parameters.

    The share for a poorly known surface is scaled so that it is the same up any slope whose sine exceeds LEAN_SLOPE.
    """
    poorly = clip((sigma - g[gp.SIGMA_LOW]) / (g[gp.SIGMA_HIGH] - g[gp.SIGMA_LOW]), 0.0, 1.0)
    return g[gp.LEAN] + g[gp.LEAN_UNCERTAIN] * poorly / max(gp.LEAN_SLOPE, abs(math.sin(board[board_row.INCLINATION])))


@njit
def wanted_axis(board, left, lean, g):
    """Where body z is wanted in `left` s (3 floats, not normalised): on the predicted normal, except for lean and bank.

    `board` (8,) the board now; `lean` rad up a vertical slope, less up others; `g` (gp.COUNT,) parameters.
    """
    nx, ny, nz = board_normal(board)
    c, s, sine = (
        math.cos(board[board_row.HEADING]),
        math.sin(board[board_row.HEADING]),
        math.sin(board[board_row.INCLINATION]),
    )
    turn, lean = board[board_row.TURN_RATE] * left, lean * sine
    pull = board[board_row.SPEED] * board[board_row.TURN_RATE] / GRAVITY
    bank = min(g[gp.BANK_MOST], g[gp.BANK_SHARE] * max(0.0, abs(pull) - g[gp.BANK_FROM]))
    bank = math.copysign(bank, pull)
    wx = nx - turn * ny + lean * nz * c - bank * s
    wy = ny + turn * nx + lean * nz * s + bank * c
    return wx, wy, nz + lean * sine


@njit
def align(p, v, q, board, sigma, lean, previous, g, out):
    """Correct the roll and pitch rate of `out` ((4,): body rate FLU rad/s, thrust). True if it changed them.

    `p`, `v` (3,) world, `q` (4,) world from body; `board` (8,) the board now; `sigma` m of the board's surface along
    its normal; `lean` rad up a vertical slope; `previous` (4,) the command flown last; `g` (gp.COUNT,) parameters.
    """
    zx, zy, zz = body_z(q)
    height, closing, cosine, beside = approach(p, v, zx, zy, zz, board, g[gp.BELOW], g[gp.RADIUS])
    offset = g[gp.ALIGN_OFFSET]
    if closing < g[gp.ALIGN_CLOSING] or cosine < g[gp.ALIGN_COSINE] or beside > offset * offset:
        return False
    left = (height - min(g[gp.ALIGN_EARLIEST], g[gp.ALIGN_SIGMAS] * sigma)) / closing
    if left > g[gp.ALIGN_WITHIN]:
        return False
    left = max(0.0, left)
    wx, wy, wz = wanted_axis(board, left, lean, g)
    off = rotate_back(q, zy * wz - zz * wy, zz * wx - zx * wz, zx * wy - zy * wx)
    span = max(g[gp.ALIGN_SHORTEST], left - g[gp.RATE_LAG])
    limit, band, changed = g[gp.RATE_MAX], g[gp.ALIGN_BAND], False
    for axis in range(2):
        asked = out[axis]
        then = off[axis] - previous[axis] * g[gp.RATE_LAG] - asked * span
        excess = then - clip(then, -band, band)
        if excess != 0.0:
            out[axis] = command_within(asked + excess / span, -limit, limit)
            changed = changed or out[axis] != asked
    return changed
