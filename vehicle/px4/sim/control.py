"""PX4's cascade above the rate loop, as a kernel: position and velocity -> attitude and thrust -> body rates.

World ENU, body FLU; PX4's parameters by name in the (NC,) control row. What PX4 computes in NED comes out the same
here, because the cascade has no preferred horizontal axis.
"""

from __future__ import annotations

import math

from kernel.jit import njit
from kernel.rotations import body_z, conjugate, from_euler, multiply, normalise, wrap_angle, yaw
from vehicle.quadrotor.airframe import GRAVITY

OFF, RATES, ATTITUDE, POSITION = 0.0, 1.0, 2.0, 3.0

# Indices of a control row. Set-points (NaN: not given):
MODE = 0
RATE_SP = 1  # 3, rad/s, body
THRUST_SP = 4  # 0..1
ATT_SP = 5  # 4, world from body
POS_SP, VEL_SP, ACC_SP = 9, 12, 15  # 3 each, world
YAW_SP, YAW_RATE_SP = 18, 19
SMOOTH = 20  # 1: AUTO, the velocity set-point is slewed
MAX_XY, MAX_UP, MAX_DOWN, MAX_TILT = 21, 22, 23, 24  # m/s, rad
RAMP = 25  # m/s, ceiling of the climb rate while taking off; inf otherwise
LANDED = 26  # 1: integrators stay empty unless a take-off ramp runs
# States:
VEL_INT, VEL_SMOOTH, ACC_LP, VEL_LAST = 27, 30, 33, 36  # 3 each
YAW_SMOOTH = 39
# Results:
OUT_RATE, OUT_THRUST, OUT_ATT, ATT_THRUST = 40, 43, 44, 48
# Parameters, in the order of PARAMETERS:
GAINS = 49
PARAMETERS = (
    "MPC_XY_P",
    "MPC_Z_P",
    "MPC_XY_VEL_P_ACC",
    "MPC_XY_VEL_I_ACC",
    "MPC_XY_VEL_D_ACC",
    "MPC_Z_VEL_P_ACC",
    "MPC_Z_VEL_I_ACC",
    "MPC_Z_VEL_D_ACC",
    "MPC_THR_HOVER",
    "MPC_THR_MIN",
    "MPC_THR_MAX",
    "MC_ROLL_P",
    "MC_PITCH_P",
    "MC_YAW_P",
    "MC_YAW_WEIGHT",
    "MC_ROLLRATE_MAX",
    "MC_PITCHRATE_MAX",
    "MC_YAWRATE_MAX",
    "MPC_ACC_HOR",
    "MPC_ACC_UP_MAX",
    "MPC_ACC_DOWN_MAX",
    "MPC_YAWRAUTO_MAX",
    "MPC_VELD_LP",
)
NC = GAINS + len(PARAMETERS)
_XY_P, _Z_P, _XY_VP, _XY_VI, _XY_VD, _Z_VP, _Z_VI, _Z_VD = (GAINS + i for i in range(8))
_HOVER, _THR_MIN, _THR_MAX, _ROLL_P, _PITCH_P, _YAW_P, _YAW_WEIGHT = (GAINS + 8 + i for i in range(7))
_RATE_MAX, _ACC_HOR, _ACC_UP, _ACC_DOWN, _YAW_AUTO, _VELD_LP = (GAINS + i for i in (15, 18, 19, 20, 21, 22))

# Indices of an estimate row.
EST_P, EST_V, EST_Q, EST_W = 0, 3, 6, 10
NE = 13


@njit
def attitude_step(c, est):
    """Body rates for the attitude set-point OUT_ATT; yaw weighs less than thrust direction (PX4 AttitudeControl)."""
    q = (est[EST_Q], est[EST_Q + 1], est[EST_Q + 2], est[EST_Q + 3])
    target = (c[OUT_ATT], c[OUT_ATT + 1], c[OUT_ATT + 2], c[OUT_ATT + 3])
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
    half = c[_YAW_WEIGHT] * math.atan2(sign * mix[3], max(0.0, min(1.0, sign * mix[0])))
    error = multiply(conjugate(q), multiply(reduced, (math.cos(half), 0.0, 0.0, math.sin(half))))
    sign = 2.0 if error[0] >= 0.0 else -2.0
    weight = max(c[_YAW_WEIGHT], 0.05)
    gains = (c[_ROLL_P], c[_PITCH_P], c[_YAW_P] / weight)
    ux, uy, uz = conjugate_z(q)
    feed = 0.0 if math.isnan(c[YAW_RATE_SP]) else c[YAW_RATE_SP]
    c[OUT_RATE] = sign * error[1] * gains[0] + feed * ux
    c[OUT_RATE + 1] = sign * error[2] * gains[1] + feed * uy
    c[OUT_RATE + 2] = sign * error[3] * gains[2] + feed * uz
    for axis in range(3):
        limit = math.radians(c[_RATE_MAX + axis])
        c[OUT_RATE + axis] = min(limit, max(-limit, c[OUT_RATE + axis]))


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
    vx, vy, vz = c[VEL_SP], c[VEL_SP + 1], c[VEL_SP + 2]
    if not math.isnan(c[POS_SP]):
        vx = c[_XY_P] * (c[POS_SP] - est[EST_P]) + (0.0 if math.isnan(vx) else vx)
    if not math.isnan(c[POS_SP + 1]):
        vy = c[_XY_P] * (c[POS_SP + 1] - est[EST_P + 1]) + (0.0 if math.isnan(vy) else vy)
    if not math.isnan(c[POS_SP + 2]):
        vz = c[_Z_P] * (c[POS_SP + 2] - est[EST_P + 2]) + (0.0 if math.isnan(vz) else vz)
    speed = math.hypot(vx, vy)
    if speed > c[MAX_XY]:
        vx, vy = vx * c[MAX_XY] / speed, vy * c[MAX_XY] / speed
    if not math.isnan(vz):
        vz = min(max(-c[MAX_DOWN], min(vz, c[MAX_UP])), c[RAMP])
    if c[SMOOTH] > 0.0:
        if not (math.isnan(vx) or math.isnan(vy)):
            dx, dy = vx - c[VEL_SMOOTH], vy - c[VEL_SMOOTH + 1]
            change, most = math.hypot(dx, dy), c[_ACC_HOR] * dt
            if change > most:
                vx, vy = c[VEL_SMOOTH] + dx * most / change, c[VEL_SMOOTH + 1] + dy * most / change
            c[VEL_SMOOTH], c[VEL_SMOOTH + 1] = vx, vy
        if not math.isnan(vz):
            if math.isinf(c[RAMP]):
                vz = max(c[VEL_SMOOTH + 2] - c[_ACC_DOWN] * dt, min(vz, c[VEL_SMOOTH + 2] + c[_ACC_UP] * dt))
            c[VEL_SMOOTH + 2] = vz
    return vx, vy, vz


@njit
def position_step(c, est, dt):
    """OUT_ATT and OUT_THRUST from position, velocity and acceleration set-points (PX4 PositionControl)."""
    vx, vy, vz = _velocity_setpoint(c, est, dt)
    ax = 0.0 if math.isnan(c[ACC_SP]) else c[ACC_SP]
    ay = 0.0 if math.isnan(c[ACC_SP + 1]) else c[ACC_SP + 1]
    az = 0.0 if math.isnan(c[ACC_SP + 2]) else c[ACC_SP + 2]
    alpha = dt / (dt + 1.0 / (2.0 * math.pi * c[_VELD_LP]))
    for axis in range(3):
        measured = (est[EST_V + axis] - c[VEL_LAST + axis]) / dt
        c[VEL_LAST + axis] = est[EST_V + axis]
        c[ACC_LP + axis] += alpha * (measured - c[ACC_LP + axis])
    ex = 0.0 if math.isnan(vx) else vx - est[EST_V]
    ey = 0.0 if math.isnan(vy) else vy - est[EST_V + 1]
    ez = 0.0 if math.isnan(vz) else vz - est[EST_V + 2]
    ax += c[_XY_VP] * ex + c[VEL_INT] - c[_XY_VD] * c[ACC_LP]
    ay += c[_XY_VP] * ey + c[VEL_INT + 1] - c[_XY_VD] * c[ACC_LP + 1]
    az += c[_Z_VP] * ez + c[VEL_INT + 2] - c[_Z_VD] * c[ACC_LP + 2]

    lean, most = math.hypot(ax, ay), GRAVITY * math.tan(c[MAX_TILT])
    saturated = lean > most
    if saturated:
        ax, ay = ax * most / lean, ay * most / lean
    n = math.sqrt(ax * ax + ay * ay + GRAVITY * GRAVITY)
    zx, zy, zz = ax / n, ay / n, GRAVITY / n
    least = c[_THR_MIN] if math.isinf(c[RAMP]) else 0.0
    vertical = c[_HOVER] * (1.0 + az / GRAVITY)
    thrust = max(least, min(c[_THR_MAX], vertical / zz))

    if c[LANDED] > 0.0 and math.isinf(c[RAMP]):
        for axis in range(3):
            c[VEL_INT + axis] = 0.0
    else:
        if not saturated:
            c[VEL_INT] += c[_XY_VI] * ex * dt
            c[VEL_INT + 1] += c[_XY_VI] * ey * dt
        if not ((vertical <= c[_THR_MIN] and ez < 0.0) or (vertical >= c[_THR_MAX] and ez > 0.0)):
            c[VEL_INT + 2] = max(-GRAVITY, min(GRAVITY, c[VEL_INT + 2] + c[_Z_VI] * ez * dt))

    heading = yaw((est[EST_Q], est[EST_Q + 1], est[EST_Q + 2], est[EST_Q + 3]))
    if math.isnan(c[YAW_SP]):
        if not math.isnan(c[YAW_RATE_SP]):
            c[YAW_SMOOTH] = heading
    elif c[SMOOTH] > 0.0:
        step = math.radians(c[_YAW_AUTO]) * dt
        c[YAW_SMOOTH] = wrap_angle(c[YAW_SMOOTH] + max(-step, min(step, wrap_angle(c[YAW_SP] - c[YAW_SMOOTH]))))
    else:
        c[YAW_SMOOTH] = c[YAW_SP]
    # Tilt that points body z along (zx, zy, zz) after turning to the heading.
    ch, sh = math.cos(c[YAW_SMOOTH]), math.sin(c[YAW_SMOOTH])
    q = from_euler(
        -math.asin(max(-1.0, min(1.0, -sh * zx + ch * zy))), math.atan2(ch * zx + sh * zy, zz), c[YAW_SMOOTH]
    )
    c[OUT_ATT], c[OUT_ATT + 1], c[OUT_ATT + 2], c[OUT_ATT + 3] = q[0], q[1], q[2], q[3]
    c[OUT_THRUST], c[ATT_THRUST] = thrust, thrust


@njit
def control_step(c, est, dt):
    """Run what MODE asks for; afterwards OUT_RATE (rad/s, FLU) and OUT_THRUST (0..1) are the rate loop's set-points."""
    mode = c[MODE]
    if mode == POSITION:
        position_step(c, est, dt)
        attitude_step(c, est)
    elif mode == ATTITUDE:
        for i in range(4):
            c[OUT_ATT + i] = c[ATT_SP + i]
        c[OUT_THRUST], c[ATT_THRUST] = c[THRUST_SP], c[THRUST_SP]
        attitude_step(c, est)
    elif mode == RATES:
        for axis in range(3):
            c[OUT_RATE + axis] = c[RATE_SP + axis]
        c[OUT_THRUST] = c[THRUST_SP]
    else:
        for axis in range(3):
            c[OUT_RATE + axis] = 0.0
        c[OUT_THRUST] = 0.0


@njit
def reset_cascade(c, est):
    """Forget the cascade's history: empty integrators, start slewing from the present velocity and heading."""
    for axis in range(3):
        c[VEL_INT + axis] = 0.0
        c[ACC_LP + axis] = 0.0
        c[VEL_SMOOTH + axis] = est[EST_V + axis]
        c[VEL_LAST + axis] = est[EST_V + axis]
    c[YAW_SMOOTH] = yaw((est[EST_Q], est[EST_Q + 1], est[EST_Q + 2], est[EST_Q + 3]))
