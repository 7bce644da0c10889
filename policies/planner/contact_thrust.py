"""Thrust in the last moment before contact.

By then body z turns onto the board's normal, and another turn would disturb that. Thrust acts along body z and turns
nothing, so it can respond to what the board did since the plan was frozen. On a steep board gravity accelerates the
vehicle along the slope by up to g: a contact 0.1 s early or late skids. So each thrust is judged by the contact that it
leads to: speed along the board, speed into the board, and time relative to the attitude's arrival.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from groundcar.motion.pose import board_normal
from kernel.clip import clip
from kernel.jit import njit
from policies.guidance.approach import approach
from policies.planner import params_row as pp
from vehicle.quadrotor.airframe import GRAVITY

_FROM, _FULL = 0.5, 0.8  # cosine between body z and normal at which this thrust begins to count, and counts fully
_CHOICES = 15  # thrusts that are tried
_NEAREST = 0.003  # m, height that is taken at least


@njit
def _cost(height, speed, away, sideways, along, left, wanted, params):
    """Cost of the contact reached from `height` m over the board; infinite if there is none.

    `speed` towards the board and `along` it, m/s; `away`, `sideways` the accelerations under the thrust that is judged,
    m/s^2; `left` s to the planned contact; `wanted` m/s into the board.
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
def contact_thrust(p, v, zx, zy, zz, board, acceleration, left, planned, given, gain, sigma, params):
    """Thrust (m/s^2) that leads to the contact of least cost.

    `p`, `v` (3,) world; (zx, zy, zz) body z; `board` (8,) the board now, `acceleration` m/s^2 of the board along its
    heading; `left` s to the planned contact; `planned` m/s^2, the plan's thrust, returned while body z is far from the
    normal; `given` m/s^2, thrust of the motors now; `gain` achieved over commanded thrust; `sigma` m, one-sigma of the
    board's surface along its normal. Half of the cost is for the surface where it is believed to be, half for it
    `Terminal.sigmas` sigmas nearer and farther. While the motors lag, the old thrust goes on acting: that change of
    speed is applied at once.
    """
    height, closing, cosine, _ = approach(
        p, v, zx, zy, zz, board, params[pp.vehicle.contact_below], params[pp.vehicle.contact_radius]
    )
    share = clip((cosine - _FROM) / (_FULL - _FROM), 0.0, 1.0)
    if share <= 0.0:
        return planned
    nx, ny, nz = board_normal(board)
    c, s = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    ux, uy, uz = nz * c, nz * s, math.sin(board[board_row.INCLINATION])  # up the slope
    wx, wy, wz = v[0] - board[board_row.SPEED] * c, v[1] - board[board_row.SPEED] * s, v[2]
    along = ux * wx + uy * wy + uz * wz
    g, drag = GRAVITY, params[pp.vehicle.drag]
    # Acceleration relative to the board without thrust, along normal and slope.
    normal = -g * nz - drag * (nx * v[0] + ny * v[1] + nz * v[2]) - acceleration * (nx * c + ny * s)
    slope = -g * uz - drag * (ux * v[0] + uy * v[1] + uz * v[2]) - acceleration * (ux * c + uy * s)
    lean = 0.5 * (ux * zx + uy * zy + uz * zz)
    lift = 0.5 * (1.0 + cosine)
    least, best = math.inf, planned
    wanted = params[pp.terminal.speed] + params[pp.terminal.speed_steep] * math.sin(board[board_row.INCLINATION])
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
