"""Impact-speed limit: thrust that bounds the speed into the board at contact.

In the last moment body z is near the board's normal, so that thrust alone decides the impact speed. A policy keeps some
speed in reserve, because a late contact slides down the slope. Where the surface is well known and the vehicle hardly
slides, that reserve is not needed and is braked away. Thrust is only ever raised.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from groundcar.motion.pose import board_normal
from kernel.clip import clip
from kernel.jit import njit
from kernel.rotations import body_z
from policies.guidance import params as gp
from policies.guidance.approach import approach
from vehicle.quadrotor import command_row
from vehicle.quadrotor.airframe import GRAVITY

_LEAST_GAIN = 0.3  # a smaller thrust gain is taken to be this


@njit
def limit_impact(p, v, q, board, sigma, previous, gain, drag, g, out):
    """Raise the thrust of `out` ((4,)) as far as a contact at `impact_speed` asks for. True if it changed it.

    Arguments as of `alignment.align`; `gain`: achieved over asked thrust; `drag` 1/s, of the vehicle. Under a thrust f,
    of which `lift` acts along the normal, and the pull along it, half the squared closing speed falls by
    lift * f + pull on every metre. Until the motors have followed, the previous thrust acts.
    """
    zx, zy, zz = body_z(q)
    centre, closing, cosine, beside = approach(p, v, zx, zy, zz, board, 0.0, 0.0)
    height = centre - g[gp.BELOW] - g[gp.IMPACT_TILT] * g[gp.RADIUS]
    into, offset = g[gp.IMPACT_SPEED], g[gp.IMPACT_OFFSET]
    if height <= 0.0 or closing <= into or cosine < g[gp.IMPACT_COSINE] or beside > offset * offset:
        return False
    left = height / max(closing, g[gp.ALIGN_CLOSING])
    if left > g[gp.IMPACT_WITHIN]:
        return False
    low, high = g[gp.THRUST_MIN], g[gp.THRUST_MAX]
    nx, ny, nz = board_normal(board)
    # Acceleration without thrust, and its part along the normal.
    ax, ay, az = -drag * v[0], -drag * v[1], -GRAVITY - drag * v[2]
    pull = nx * ax + ny * ay + nz * az
    lift, asked = 0.5 * (1.0 + cosine), clip(out[command_row.THRUST], low, high)
    # Speed along the board at contact if the thrust asked acts until then.
    push = gain * asked
    sx = v[0] - board[board_row.SPEED] * math.cos(board[board_row.HEADING]) + left * (push * zx + ax)
    sy = v[1] - board[board_row.SPEED] * math.sin(board[board_row.HEADING]) + left * (push * zy + ay)
    sz = v[2] + left * (push * zz + az)
    along = nx * sx + ny * sy + nz * sz
    sx, sy, sz = sx - along * nx, sy - along * ny, sz - along * nz
    sliding = math.sqrt(sx * sx + sy * sy + sz * sz)
    share = (g[gp.SLIDING_HIGH] - sliding) / (g[gp.SLIDING_HIGH] - g[gp.SLIDING_LOW])
    known = (g[gp.SIGMA_HIGH] - sigma) / (g[gp.SIGMA_HIGH] - g[gp.SIGMA_LOW])
    share = clip(share, 0.0, 1.0) * clip(known, 0.0, 1.0)
    # Work that thrust has to do, less what the previous thrust does while the motors lag.
    way, lagging = height + g[gp.IMPACT_MARGIN], g[gp.THRUST_LAG] * closing
    given = gain * clip(previous[command_row.THRUST], low, high)
    work = 0.5 * (closing * closing - into * into) - pull * way - lift * given * lagging
    needed = work / (lift * max(g[gp.IMPACT_SHORTEST], way - lagging)) / max(_LEAST_GAIN, gain)
    raised = share * (clip(needed, low, high) - asked)
    if raised <= 0.0:
        return False
    out[command_row.THRUST] = asked + raised
    return True
