"""Tracking the planned motion to the board; in the last moment thrust alone is corrected."""

from __future__ import annotations

from kernel.clip import clip
from kernel.jit import njit
from kernel.rotations import body_z
from policies.estimation.own_state import WAIT
from policies.planner import params_row as pp
from policies.planner import polynomial as poly
from policies.planner.contact_thrust import contact_thrust
from policies.planner.follow import face
from policies.planner.tracking import track_force
from vehicle.quadrotor.airframe import GRAVITY

_C = poly.COEFFICIENTS


@njit
def fly_motion(m, since, duration, left, p, v, q, board, acceleration, gain, given, sigma, params, out):
    """Fill `out` (4,): body rate FLU (rad/s), collective thrust (m/s^2).

    `m` (MOTION_DIM,): the motion, begun `since` s ago; it ends at contact after `duration` s, in `left` s. `p`, `v`
    (3,) world, `q` (4,) world from body; `board` (8,) the board now, `acceleration` m/s^2 its own along its heading;
    `gain` achieved over commanded thrust, `given` m/s^2 the thrust of the motors now; `sigma`
    m of the board's surface along its normal.
    """
    now = min(duration, since)
    fade = clip(left / max(params[pp.tracking.fade], 1e-6), 0.0, 1.0)
    kp, kv = params[pp.tracking.kp] * fade, params[pp.tracking.kv] * fade
    drag, g = params[pp.vehicle.drag], GRAVITY
    ahead, soon = (
        min(duration, now + params[pp.tracking.rate_ahead]),
        min(duration, now + params[pp.vehicle.thrust_lag] + WAIT),
    )
    bx = kp * (poly.position(m, 0, now) - p[0]) + kv * (poly.velocity(m, 0, now) - v[0]) + drag * v[0]
    by = kp * (poly.position(m, _C, now) - p[1]) + kv * (poly.velocity(m, _C, now) - v[1]) + drag * v[1]
    bz = kp * (poly.position(m, 2 * _C, now) - p[2]) + kv * (poly.velocity(m, 2 * _C, now) - v[2]) + drag * v[2] + g
    fx, fy = poly.acceleration(m, 0, now) + bx, poly.acceleration(m, _C, now) + by
    fz = poly.acceleration(m, 2 * _C, now) + bz
    gx, gy = poly.acceleration(m, 0, ahead) + bx, poly.acceleration(m, _C, ahead) + by
    gz = poly.acceleration(m, 2 * _C, ahead) + bz
    moving = 1.0 if since + params[pp.tracking.rate_ahead] < duration else 0.0
    jx, jy, jz = moving * poly.jerk(m, 0, ahead), moving * poly.jerk(m, _C, ahead), moving * poly.jerk(m, 2 * _C, ahead)
    # Thrust does not turn the vehicle, so its feedback stays to the end; overdue, it goes on at the contact speed.
    late = max(0.0, -left)
    kp, kv = params[pp.tracking.kp], params[pp.tracking.kv]
    v1x, v1y, v1z = poly.velocity(m, 0, now), poly.velocity(m, _C, now), poly.velocity(m, 2 * _C, now)
    sx = kp * (poly.position(m, 0, now) + late * v1x - p[0]) + kv * (v1x - v[0]) + drag * v[0]
    sy = kp * (poly.position(m, _C, now) + late * v1y - p[1]) + kv * (v1y - v[1]) + drag * v[1]
    sz = kp * (poly.position(m, 2 * _C, now) + late * v1z - p[2]) + kv * (v1z - v[2]) + drag * v[2] + g
    if left > 0.0:
        sx, sy = sx + poly.acceleration(m, 0, soon), sy + poly.acceleration(m, _C, soon)
        sz += poly.acceleration(m, 2 * _C, soon)
    zx, zy, zz = body_z(q)
    thrust = sx * zx + sy * zy + sz * zz
    yaw_rate = face(q, p, board, params) if left > 0.5 else 0.0
    if left < params[pp.terminal.start]:
        thrust = contact_thrust(p, v, zx, zy, zz, board, acceleration, left, thrust, given, gain, sigma, params)
    track_force(q, fx, fy, fz, gx, gy, gz, jx, jy, jz, yaw_rate, thrust, gain, params, out)
