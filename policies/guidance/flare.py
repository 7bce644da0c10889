"""Time-to-go flare: the last moment to begin the turn onto a steep board.

A board of 70 deg is met after a turn by more than that in half a second, at body rates near the limit. A vehicle that
turns gently for too long, because it has little thrust to brake with, meets the board before the turn is complete. The
time to contact is predicted with full braking thrust. When the rest of the turn needs the mean rate `flare_rate` until
then, the flare asks for that rate. Before that moment nothing changes.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.clip import command_within
from kernel.jit import njit
from kernel.rotations import body_z, rotate_back
from policies.guidance import params as gp
from policies.guidance.alignment import wanted_axis
from policies.guidance.approach import approach
from vehicle.quadrotor.airframe import GRAVITY


@njit
def flare(p, v, q, board, lean, previous, gain, g, out):
    """Set the roll and pitch rate of `out` ((4,)) if it is the last moment for the turn. True if it changed them.

    Arguments as of `alignment.align`; `gain`: achieved over asked thrust.
    """
    zx, zy, zz = body_z(q)
    centre, closing, cosine, beside = approach(p, v, zx, zy, zz, board, 0.0, 0.0)
    # The contact disc as it lies once body z is aligned.
    height = centre - g[gp.BELOW] - g[gp.RADIUS] * lean * math.sin(board[board_row.INCLINATION])
    offset = g[gp.FLARE_OFFSET]
    if height <= 0.0 or closing < g[gp.FLARE_CLOSING] or cosine < 0.0 or beside > offset * offset:
        return False
    brake = 0.5 * gain * g[gp.THRUST_MAX] * (1.0 + cosine) - GRAVITY * math.cos(board[board_row.INCLINATION])
    stopping = closing * closing - 2.0 * brake * height
    if stopping <= 0.0:
        return False
    left = 2.0 * height / (closing + math.sqrt(stopping))
    if left > g[gp.FLARE_WITHIN]:
        return False
    wx, wy, wz = wanted_axis(board, left, lean, g)
    ox, oy, oz = zy * wz - zz * wy, zz * wx - zx * wz, zx * wy - zy * wx
    sine = math.sqrt(ox * ox + oy * oy + oz * oz)
    scale = math.atan2(sine, zx * wx + zy * wy + zz * wz) / max(sine, 1e-6)
    off = rotate_back(q, scale * ox, scale * oy, scale * oz)
    lag, span = g[gp.RATE_LAG], max(g[gp.FLARE_SHORTEST], left - g[gp.RATE_LAG])
    roll, pitch = (off[0] - previous[0] * lag) / span, (off[1] - previous[1] * lag) / span
    if roll * roll + pitch * pitch <= g[gp.FLARE_RATE] * g[gp.FLARE_RATE]:
        return False
    limit, before = g[gp.RATE_MAX], (out[0], out[1])
    out[0], out[1] = command_within(roll, -limit, limit), command_within(pitch, -limit, limit)
    return out[0] != before[0] or out[1] != before[1]
