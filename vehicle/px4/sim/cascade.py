"""PX4's cascade above the rate loop, as a kernel: position and velocity -> attitude and thrust -> body rates.

World ENU, body FLU; PX4's parameters by name in the control row. What PX4 computes in NED gives the same result
here, because the cascade has no preferred horizontal axis.
"""

from __future__ import annotations

import math

from kernel.jit import njit
from kernel.rotations import body_z, conjugate, from_euler, multiply, normalise, wrap_angle, yaw
from vehicle.px4.sim.rows import control, estimate
from vehicle.quadrotor.airframe import GRAVITY


@njit
def quaternion_at(row, at):
    """The quaternion (4 floats, w x y z) that starts at index `at` of a row."""
    return row[at], row[at + 1], row[at + 2], row[at + 3]


@njit
def attitude_step(c, est):
    """Body rates for the attitude set-point OUT_ATT; yaw weighs less than thrust direction (PX4 AttitudeControl)."""
    q = quaternion_at(est, estimate.ATTITUDE)
    target = quaternion_at(c, control.OUT_ATT)
    zx, zy, zz = body_z(q)
    tx, ty, tz = body_z(target)
    w = 1.0 + zx * tx + zy * ty + zz * tz
    if w > 1e-5:  # the shortest turn that points the thrust the right way
        tilt = normalise((w, zy * tz - zz * ty, zz * tx - zx * tz, zx * ty - zy * tx))
        reduced = multiply(tilt, q)
    else:
        reduced = target
    mix = multiply(conjugate(reduced), target)
    sign = 1.0 if mix[0] >= 0.0 else -1.0
    half = c[control.YAW_WEIGHT] * math.atan2(sign * mix[3], max(0.0, min(1.0, sign * mix[0])))
    error = multiply(conjugate(q), multiply(reduced, (math.cos(half), 0.0, 0.0, math.sin(half))))
    sign = 2.0 if error[0] >= 0.0 else -2.0
    weight = max(c[control.YAW_WEIGHT], 0.05)
    gains = (c[control.ROLL_P], c[control.PITCH_P], c[control.YAW_P] / weight)
    ux, uy, uz = conjugate_z(q)
    feed = 0.0 if math.isnan(c[control.YAW_RATE_SP]) else c[control.YAW_RATE_SP]
    c[control.OUT_RATE] = sign * error[1] * gains[0] + feed * ux
    c[control.OUT_RATE + 1] = sign * error[2] * gains[1] + feed * uy
    c[control.OUT_RATE + 2] = sign * error[3] * gains[2] + feed * uz
    for axis in range(3):
        limit = math.radians(c[control.RATE_MAX + axis])
        c[control.OUT_RATE + axis] = min(limit, max(-limit, c[control.OUT_RATE + axis]))


@njit
def conjugate_z(q):
    """The world's z axis in the body (3 floats)."""
    return (
        2.0 * (q[1] * q[3] - q[0] * q[2]),
        2.0 * (q[2] * q[3] + q[0] * q[1]),
        1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]),
    )


@njit
def _velocity_setpoint(c, est, dt):
    """Velocity wanted (3 floats; NaN: only acceleration is controlled), within limits and slewed in AUTO."""
    vx, vy, vz = c[control.VEL_SP], c[control.VEL_SP + 1], c[control.VEL_SP + 2]
    if not math.isnan(c[control.POS_SP]):
        vx = c[control.XY_P] * (c[control.POS_SP] - est[estimate.POSITION]) + (0.0 if math.isnan(vx) else vx)
    if not math.isnan(c[control.POS_SP + 1]):
        vy = c[control.XY_P] * (c[control.POS_SP + 1] - est[estimate.POSITION + 1]) + (0.0 if math.isnan(vy) else vy)
    if not math.isnan(c[control.POS_SP + 2]):
        vz = c[control.Z_P] * (c[control.POS_SP + 2] - est[estimate.POSITION + 2]) + (0.0 if math.isnan(vz) else vz)
    speed = math.hypot(vx, vy)
    if speed > c[control.MAX_XY]:
        vx, vy = vx * c[control.MAX_XY] / speed, vy * c[control.MAX_XY] / speed
    if not math.isnan(vz):
        vz = min(max(-c[control.MAX_DOWN], min(vz, c[control.MAX_UP])), c[control.RAMP])
    if c[control.SMOOTH] > 0.0:
        if not (math.isnan(vx) or math.isnan(vy)):
            dx, dy = vx - c[control.VEL_SMOOTH], vy - c[control.VEL_SMOOTH + 1]
            change, most = math.hypot(dx, dy), c[control.ACC_HOR] * dt
            if change > most:
                vx, vy = c[control.VEL_SMOOTH] + dx * most / change, c[control.VEL_SMOOTH + 1] + dy * most / change
            c[control.VEL_SMOOTH], c[control.VEL_SMOOTH + 1] = vx, vy
        if not math.isnan(vz):
            if math.isinf(c[control.RAMP]):
                last = c[control.VEL_SMOOTH + 2]
                vz = max(last - c[control.ACC_DOWN] * dt, min(vz, last + c[control.ACC_UP] * dt))
            c[control.VEL_SMOOTH + 2] = vz
    return vx, vy, vz


@njit
def position_step(c, est, dt):
    """OUT_ATT and control.OUT_THRUST from position, velocity and acceleration set-points (PX4 PositionControl)."""
    vx, vy, vz = _velocity_setpoint(c, est, dt)
    ax = 0.0 if math.isnan(c[control.ACC_SP]) else c[control.ACC_SP]
    ay = 0.0 if math.isnan(c[control.ACC_SP + 1]) else c[control.ACC_SP + 1]
    az = 0.0 if math.isnan(c[control.ACC_SP + 2]) else c[control.ACC_SP + 2]
    alpha = dt / (dt + 1.0 / (2.0 * math.pi * c[control.VELD_LP]))
    for axis in range(3):
        measured = (est[estimate.VELOCITY + axis] - c[control.VEL_LAST + axis]) / dt
        c[control.VEL_LAST + axis] = est[estimate.VELOCITY + axis]
        c[control.ACC_LP + axis] += alpha * (measured - c[control.ACC_LP + axis])
    ex = 0.0 if math.isnan(vx) else vx - est[estimate.VELOCITY]
    ey = 0.0 if math.isnan(vy) else vy - est[estimate.VELOCITY + 1]
    ez = 0.0 if math.isnan(vz) else vz - est[estimate.VELOCITY + 2]
    ax += c[control.XY_VEL_P] * ex + c[control.VEL_INT] - c[control.XY_VEL_D] * c[control.ACC_LP]
    ay += c[control.XY_VEL_P] * ey + c[control.VEL_INT + 1] - c[control.XY_VEL_D] * c[control.ACC_LP + 1]
    az += c[control.Z_VEL_P] * ez + c[control.VEL_INT + 2] - c[control.Z_VEL_D] * c[control.ACC_LP + 2]

    lean, most = math.hypot(ax, ay), GRAVITY * math.tan(c[control.MAX_TILT])
    saturated = lean > most
    if saturated:
        ax, ay = ax * most / lean, ay * most / lean
    n = math.sqrt(ax * ax + ay * ay + GRAVITY * GRAVITY)
    zx, zy, zz = ax / n, ay / n, GRAVITY / n
    least = c[control.THR_MIN] if math.isinf(c[control.RAMP]) else 0.0
    vertical = c[control.THR_HOVER] * (1.0 + az / GRAVITY)
    thrust = max(least, min(c[control.THR_MAX], vertical / zz))

    if c[control.LANDED] > 0.0 and math.isinf(c[control.RAMP]):
        for axis in range(3):
            c[control.VEL_INT + axis] = 0.0
    else:
        if not saturated:
            c[control.VEL_INT] += c[control.XY_VEL_I] * ex * dt
            c[control.VEL_INT + 1] += c[control.XY_VEL_I] * ey * dt
        if not ((vertical <= c[control.THR_MIN] and ez < 0.0) or (vertical >= c[control.THR_MAX] and ez > 0.0)):
            c[control.VEL_INT + 2] = max(-GRAVITY, min(GRAVITY, c[control.VEL_INT + 2] + c[control.Z_VEL_I] * ez * dt))

    heading = yaw(quaternion_at(est, estimate.ATTITUDE))
    if math.isnan(c[control.YAW_SP]):
        if not math.isnan(c[control.YAW_RATE_SP]):
            c[control.YAW_SMOOTH] = heading
    elif c[control.SMOOTH] > 0.0:
        step = math.radians(c[control.YAW_AUTO]) * dt
        turn = wrap_angle(c[control.YAW_SP] - c[control.YAW_SMOOTH])
        c[control.YAW_SMOOTH] = wrap_angle(c[control.YAW_SMOOTH] + max(-step, min(step, turn)))
    else:
        c[control.YAW_SMOOTH] = c[control.YAW_SP]
    # Tilt that points body z along (zx, zy, zz) after turning to the heading.
    ch, sh = math.cos(c[control.YAW_SMOOTH]), math.sin(c[control.YAW_SMOOTH])
    q = from_euler(
        -math.asin(max(-1.0, min(1.0, -sh * zx + ch * zy))), math.atan2(ch * zx + sh * zy, zz), c[control.YAW_SMOOTH]
    )
    for i in range(4):
        c[control.OUT_ATT + i] = q[i]
    c[control.OUT_THRUST], c[control.ATT_THRUST] = thrust, thrust


@njit
def control_step(c, est, dt):
    """Run what MODE asks for; then OUT_RATE (rad/s, FLU) and OUT_THRUST (0..1) are the rate loop's set-points."""
    mode = c[control.MODE]
    if mode == control.POSITION:
        position_step(c, est, dt)
        attitude_step(c, est)
    elif mode == control.ATTITUDE:
        for i in range(4):
            c[control.OUT_ATT + i] = c[control.ATT_SP + i]
        c[control.OUT_THRUST], c[control.ATT_THRUST] = c[control.THRUST_SP], c[control.THRUST_SP]
        attitude_step(c, est)
    elif mode == control.RATES:
        for axis in range(3):
            c[control.OUT_RATE + axis] = c[control.RATE_SP + axis]
        c[control.OUT_THRUST] = c[control.THRUST_SP]
    else:
        for axis in range(3):
            c[control.OUT_RATE + axis] = 0.0
        c[control.OUT_THRUST] = 0.0


@njit
def reset_cascade(c, est):
    """Reset the cascade: empty integrators, start slewing from the present velocity and heading."""
    for axis in range(3):
        c[control.VEL_INT + axis] = 0.0
        c[control.ACC_LP + axis] = 0.0
        c[control.VEL_SMOOTH + axis] = est[estimate.VELOCITY + axis]
        c[control.VEL_LAST + axis] = est[estimate.VELOCITY + axis]
    c[control.YAW_SMOOTH] = yaw(quaternion_at(est, estimate.ATTITUDE))
