"""From a wanted acceleration to body rates and thrust: the inner loop under the planner."""

from __future__ import annotations

import math

from kernel.clip import command_within
from kernel.jit import njit
from kernel.rotations import body_z, rotate_back
from policies.planner import params_row as pp
from vehicle.quadrotor import command_row


@njit
def track_force(q, fx, fy, fz, gx, gy, gz, jx, jy, jz, yaw_rate, thrust, gain, params, out):
    """CTBR that turns the body's z axis onto a force and follows it; fills `out` ((4,): body rate FLU rad/s, m/s^2).

    `q` (4,) world from body; `f` wanted specific force now (world, m/s^2, gravity added); `g`, `j` the specific force
    and its derivative one rate lag ahead: they feed the rate forward; `yaw_rate` about body z; `thrust` wanted m/s^2;
    `gain` achieved over commanded thrust. Rates and thrust are clipped to the limits, but NaN where not finite.
    """
    zx, zy, zz = body_z(q)
    norm = max(1e-6, math.sqrt(fx * fx + fy * fy + fz * fz))
    dx, dy, dz = fx / norm, fy / norm, fz / norm
    cx, cy, cz = zy * dz - zz * dy, zz * dx - zx * dz, zx * dy - zy * dx
    sine = math.sqrt(cx * cx + cy * cy + cz * cz)
    cosine = zx * dx + zy * dy + zz * dz
    turn = params[pp.tracking.attitude_k] * math.atan2(sine, cosine) / max(sine, 1e-6)
    ahead = max(1.0, math.sqrt(gx * gx + gy * gy + gz * gz))
    ux, uy, uz = gx / ahead, gy / ahead, gz / ahead
    rx, ry, rz = (uy * jz - uz * jy) / ahead, (uz * jx - ux * jz) / ahead, (ux * jy - uy * jx) / ahead
    wx, wy, _ = rotate_back(q, turn * cx + rx, turn * cy + ry, turn * cz + rz)
    limit = params[pp.vehicle.rate_max]
    out[command_row.RATE] = command_within(wx, -limit, limit)
    out[command_row.RATE + 1] = command_within(wy, -limit, limit)
    out[command_row.RATE + 2] = command_within(yaw_rate, -limit, limit)
    least, most = params[pp.vehicle.thrust_min], params[pp.vehicle.thrust_max]
    out[command_row.THRUST] = command_within(thrust / gain, least, most)


@njit
def yaw_error(q, dx, dy):
    """Angle (rad, (-pi, pi]) about the vertical from where the body faces to the direction (dx, dy).

    The facing is taken from the body's y axis, which stays near the horizontal during the flare.
    """
    yx, yy = 2.0 * (q[1] * q[2] - q[0] * q[3]), 1.0 - 2.0 * (q[1] * q[1] + q[3] * q[3])
    cx, cy = yy, -yx
    return math.atan2(cx * dy - cy * dx, cx * dx + cy * dy)
