"""The last moment to flare: body rates that bring a drone round in time which has begun to turn too late.

A board of 70 deg is met after a turn by more than that in half a second, at rates near the limit in the end. Who turns
gently for too long, for want of thrust to brake with, then touches before the turn is done. So the time to contact is
foretold with all thrust braking, and when the turn that is left needs LATEST on average until then, it gets just that.
Before that moment nothing changes.

The planner calls this kernel; `network_touch.py` says the same in torch, so that an exported network carries it.
"""

from __future__ import annotations

import math

from kernel.jit import njit
from kernel.rotations import body_z, rotate_back
from policies.guidance.alignment import LAG, wanted_axis
from policies.guidance.approach import approach
from vehicle.quadrotor.airframe import GRAVITY

LATEST = 3.4  # rad/s on average
WITHIN = 0.5  # s to contact
SHORTEST_TURN = 0.04  # s, of which the average is taken at least
ASIDE = 0.6  # m from the board's centre along its surface
CLOSING = 0.5  # m/s towards the board at least


@njit
def late_flare(p, v, q, board, before, strongest, lean, below, radius, limit, out):
    """Raise the roll and pitch rate of `out` ((4,): body rate FLU rad/s, thrust) if it is the last moment for it.

    Arguments as of `touch_attitude.touch_rates`; `strongest`: the most thrust that the drone really gives, m/s^2.
    """
    zx, zy, zz = body_z(q)
    centre, closing, cosine, aside = approach(p, v, zx, zy, zz, board, 0.0, 0.0)
    height = centre - below - radius * lean * math.sin(board[6])  # the disc's, once it is aligned
    if height <= 0.0 or closing < CLOSING or cosine < 0.0 or aside > ASIDE * ASIDE:
        return
    brake = 0.5 * strongest * (1.0 + cosine) - GRAVITY * math.cos(board[6])
    stopping = closing * closing - 2.0 * brake * height
    if stopping <= 0.0:
        return
    left = 2.0 * height / (closing + math.sqrt(stopping))
    if left > WITHIN:
        return
    wx, wy, wz = wanted_axis(board, left, lean)
    ox, oy, oz = zy * wz - zz * wy, zz * wx - zx * wz, zx * wy - zy * wx
    sine = math.sqrt(ox * ox + oy * oy + oz * oz)
    scale = math.atan2(sine, zx * wx + zy * wy + zz * wz) / max(sine, 1e-6)
    off = rotate_back(q, scale * ox, scale * oy, scale * oz)
    span = max(SHORTEST_TURN, left - LAG)
    roll, pitch = (off[0] - before[0] * LAG) / span, (off[1] - before[1] * LAG) / span
    if roll * roll + pitch * pitch > LATEST * LATEST:
        out[0], out[1] = min(limit, max(-limit, roll)), min(limit, max(-limit, pitch))
