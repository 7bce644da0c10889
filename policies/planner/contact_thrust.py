"""The last quarter second: thrust alone decides when and how the drone touches.

By then the body's z axis turns onto the board's normal, and to turn the drone otherwise would spoil that. Thrust acts
along the axis and turns nothing, so it can answer what the board did since the plan was frozen. On a steep board
gravity pulls the drone along the slope by up to g: contact a tenth of a second off skids. So a thrust is judged by what
it leads to: speed along the board, speed into the board, and contact before or after the attitude has arrived.
"""

from __future__ import annotations

import math

from groundcar.motion.pose import board_normal
from kernel.jit import njit
from policies.guidance.approach import approach
from policies.planner import params_row as pp
from vehicle.quadrotor.airframe import GRAVITY

_FROM, _FULL = 0.5, 0.8  # cosine between body z and normal: from where, and where it fully counts
_CHOICES = 15
_NEAREST = 0.003  # m


@njit
def _cost(height, speed, away, sideways, along, left, wanted, params):
    """What a contact costs that is made from `height` m: infinite if it leads to none.

    `speed` towards the board and `along` it, m/s; `away`, `sideways` the accelerations under the thrust that is judged,
    m/s^2.
    """
    root = speed * speed - 2.0 * away * height
    if root < 0.0 or (speed <= 0.0 and away >= 0.0):
        return math.inf
    into = math.sqrt(root)
    time = 2.0 * height / (speed + into) if speed > 0.0 else (speed - into) / away
    skid = (along + sideways * time) / params[pp.terminal.skid]
    hard = (into - wanted) / params[pp.terminal.speed_band]
    early = max(0.0, left - time) / params[pp.terminal.early]
    late = max(0.0, time - left) / params[pp.terminal.late]
    return skid * skid + hard * hard + early * early + late * late


@njit
def touch_thrust(p, v, zx, zy, zz, board, acceleration, left, planned, given, gain, sigma, params):
    """Thrust (m/s^2) whose contact is the best that thrust can still reach.

    `p`, `v` (3,) world; (zx, zy, zz) body z; `board` (8,) the board now, `acceleration` its own along its heading,
    m/s^2; `left` s to the planned contact; `planned`: the plan's thrust, which counts while body z is far from the
    normal; `given`: thrust that the motors give now; `gain`: achieved over asked thrust; `sigma` m of the board's
    surface along its normal: a thrust is judged by where the surface is believed to be, half, and by where else it may
    be. Motors lag: until they have followed, the old thrust goes on acting, which is taken off the speeds at once.
    """
    height, closing, cosine, _ = approach(
        p, v, zx, zy, zz, board, params[pp.vehicle.contact_below], params[pp.vehicle.contact_radius]
    )
    share = min(1.0, max(0.0, (cosine - _FROM) / (_FULL - _FROM)))
    if share <= 0.0:
        return planned
    nx, ny, nz = board_normal(board)
    c, s = math.cos(board[3]), math.sin(board[3])
    ux, uy, uz = nz * c, nz * s, math.sin(board[6])  # up the slope
    wx, wy, wz = v[0] - board[4] * c, v[1] - board[4] * s, v[2]
    along = ux * wx + uy * wy + uz * wz
    g, drag = GRAVITY, params[pp.vehicle.drag]
    # Relative to the board and without thrust, along normal and slope; body z is taken to arrive on the normal.
    normal = -g * nz - drag * (nx * v[0] + ny * v[1] + nz * v[2]) - acceleration * (nx * c + ny * s)
    slope = -g * uz - drag * (ux * v[0] + uy * v[1] + uz * v[2]) - acceleration * (ux * c + uy * s)
    lean = 0.5 * (ux * zx + uy * zy + uz * zz)
    lift = 0.5 * (1.0 + cosine)
    least, best = math.inf, planned
    wanted = params[pp.terminal.speed] + params[pp.terminal.speed_steep] * math.sin(board[6])
    low, high = params[pp.vehicle.thrust_min] * gain, params[pp.vehicle.thrust_max] * gain
    lag, spread = params[pp.terminal.lag], params[pp.terminal.sigmas] * sigma
    for k in range(_CHOICES):
        f = low + (high - low) * k / (_CHOICES - 1)
        away, sideways = f * lift + normal, f * lean + slope
        speed, sliding = closing - (given - f) * lift * lag, along + (given - f) * lean * lag
        cost = min(1e3 + f, _cost(max(_NEAREST, height), speed, away, sideways, sliding, left, wanted, params))
        if spread > _NEAREST:
            cost *= 0.5
            for side in (-1.0, 1.0):
                there = max(_NEAREST, height + side * spread)
                other = _cost(there, speed, away, sideways, sliding, left, wanted, params)
                cost += 0.25 * min(params[pp.terminal.no_contact], other)
        cost += params[pp.terminal.keep] * (f - planned) * (f - planned)
        if cost < least:
            least, best = cost, f
    return planned + share * (best - planned)
