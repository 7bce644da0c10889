"""PX4's body rate loop as a kernel, and `fly`: the loop, mixer, motors and rigid body over one control period.

`fly` is what training runs over thousands of rows and what the software PX4 runs behind its wire.
"""

from __future__ import annotations

import math

from kernel.jit import njit
from vehicle.quadrotor.airframe import (
    DGYRO_CUTOFF,
    GRAVITY,
    GYRO_CUTOFF,
    HOVER_THRUST,
    MIXER_ROLL_PITCH,
    MIXER_YAW,
    RATE_D,
    RATE_I,
    RATE_K,
    RATE_LIMIT_I,
    RATE_P,
    YAW_TORQUE_CUTOFF,
)
from vehicle.quadrotor.dynamics import (
    ACCEL,
    GYRO,
    HEADROOM_DOWN,
    HEADROOM_UP,
    INTEGRAL,
    RATE,
    TORQUE_YAW,
    W,
    column,
    motor_lag,
    vehicle_step,
)
from vehicle.quadrotor.mixer import mix

_PER_FADE = 1.0 / math.radians(400.0)  # the integrator's gain falls to 0 at this rate error (PX4 RateControl)
_SLACK = 1e-3  # of the torque set-point: below it an allocation counts as achieved


@njit
def filter_coefficients(params, dt):
    """Coefficients (8-tuple) of the loop's filters at substep `dt`: gyro biquad b0 b1 b2 a1 a2, d-gyro, yaw, 1/dt."""
    cutoff = params[GYRO_CUTOFF]
    if cutoff * dt < 0.45:
        c = math.tan(math.pi * cutoff * dt)
        a0 = 1.0 + 2.0 * math.cos(0.25 * math.pi) * c + c * c  # Butterworth, second order
        b0 = c * c / a0
        b1, b2 = 2.0 * b0, b0
        a1, a2 = 2.0 * (c * c - 1.0) / a0, (1.0 - 2.0 * math.cos(0.25 * math.pi) * c + c * c) / a0
    else:  # too near Nyquist to filter
        b0, b1, b2, a1, a2 = 1.0, 0.0, 0.0, 0.0, 0.0
    alpha = dt / (dt + 1.0 / (2.0 * math.pi * params[DGYRO_CUTOFF]))
    yaw_alpha = 1.0
    if params[YAW_TORQUE_CUTOFF] > 0.0:
        yaw_alpha = dt / (dt + 1.0 / (2.0 * math.pi * params[YAW_TORQUE_CUTOFF]))
    return b0, b1, b2, a1, a2, alpha, yaw_alpha, 1.0 / dt


@njit(forceinline=True)
def _law(rate, accel, integral, setpoint, up, down, gains, dt):
    """PID of one axis: (torque set-point, integrator). `up`, `down`: headroom. A set-point of NaN keeps `rate`."""
    k, p, i, d, limit = gains
    error = 0.0 if math.isnan(setpoint) else setpoint - rate
    torque = k * (p * error - d * accel) + integral
    wound = error * (up if error > 0.0 else down)
    faded = wound * _PER_FADE
    integral += max(0.0, 1.0 - faded * faded) * k * i * wound * dt
    return min(1.0, max(-1.0, torque)), min(limit, max(-limit, integral))


@njit(inline="always")
def _axis(s, k, axis, setpoint, p, c, dt):
    """Torque set-point of one axis from its filtered rate; updates the axis' filters and integrator in place."""
    g = GYRO + 2 * axis
    g0, g1 = s[g, k], s[g + 1, k]
    delayed = s[W + axis, k] - c[3] * g0 - c[4] * g1
    rate = c[0] * delayed + c[1] * g0 + c[2] * g1
    s[g + 1, k], s[g, k] = g0, delayed
    accel = s[ACCEL + axis, k]
    accel += c[5] * ((rate - s[RATE + axis, k]) * c[7] - accel)
    s[ACCEL + axis, k], s[RATE + axis, k] = accel, rate
    torque, s[INTEGRAL + axis, k] = _law(
        rate,
        accel,
        s[INTEGRAL + axis, k],
        setpoint,
        s[HEADROOM_UP + axis, k],
        s[HEADROOM_DOWN + axis, k],
        (
            p[RATE_K + axis, k],
            p[RATE_P + axis, k],
            p[RATE_I + axis, k],
            p[RATE_D + axis, k],
            p[RATE_LIMIT_I + axis, k],
        ),
        dt,
    )
    return torque


@njit(inline="always")
def torques(s, k, setpoint, p, c, dt):
    """Torque set-points (roll, pitch, yaw; -1..1) of the vehicle in column k of `s` (ND, L) for body rates (rad/s).

    One run of the rate loop; updates its filters and integrators. `p` (NP, L): airframes; `c` comes from
    `filter_coefficients` for the same airframe and `dt`. No branch, as in `dynamics.vehicle_step`.
    """
    roll = _axis(s, k, 0, setpoint[0], p, c, dt)
    pitch = _axis(s, k, 1, setpoint[1], p, c, dt)
    raw_yaw = _axis(s, k, 2, setpoint[2], p, c, dt)
    yaw = s[TORQUE_YAW, k]
    yaw += c[6] * (raw_yaw - yaw)
    s[TORQUE_YAW, k] = yaw
    return roll, pitch, yaw


@njit(forceinline=True)
def _headroom(asked, given):
    """(up, down): 0 where more, or less, of a torque was asked than the motors could give."""
    return 0.0 if asked > given + _SLACK else 1.0, 0.0 if asked < given - _SLACK else 1.0


@njit(inline="always")
def allocate(s, k, torque, thrust, p):
    """Motor commands (4-tuple, 0..1) within the motors' limits; notes which torques could not be had."""
    roll, pitch, yaw = torque
    a, b = p[MIXER_ROLL_PITCH, k], p[MIXER_YAW, k]
    u0, u1, u2, u3 = mix(roll, pitch, yaw, thrust, a, b)
    a, b = 0.25 / a, 0.25 / b
    s[HEADROOM_UP, k], s[HEADROOM_DOWN, k] = _headroom(roll, a * (-u0 + u1 + u2 - u3))
    s[HEADROOM_UP + 1, k], s[HEADROOM_DOWN + 1, k] = _headroom(pitch, a * (-u0 + u1 - u2 + u3))
    s[HEADROOM_UP + 2, k], s[HEADROOM_DOWN + 2, k] = _headroom(yaw, b * (-u0 - u1 + u2 + u3))
    return u0, u1, u2, u3


@njit(inline="always")
def rate_step(s, k, setpoint, thrust, p, c, dt):
    """One run of the rate loop and mixer for column k of `s` (ND, L): motor commands (4-tuple, 0..1).

    `setpoint`: body rates (3-tuple, rad/s, FLU), NaN means "keep the present rate", as for PX4; `thrust` 0..1.
    """
    return allocate(s, k, torques(s, k, setpoint, p, c, dt), min(1.0, max(0.0, thrust)), p)


@njit
def reset_rate_control(row):
    """Empty the loop's integrators and let its filters start at the present rate being 0 (motors stopped)."""
    for i in range(GYRO, TORQUE_YAW + 1):
        row[i] = 0.0
    for i in range(HEADROOM_UP, HEADROOM_DOWN + 3):
        row[i] = 1.0


@njit
def settle_filters(row, params, dt):
    """Put the gyro filters into the steady state of the row's present body rate (for starts in mid-air)."""
    c = filter_coefficients(params, dt)
    for axis in range(3):
        settled = row[W + axis] / (1.0 + c[3] + c[4])
        row[GYRO + 2 * axis], row[GYRO + 2 * axis + 1] = settled, settled
        row[RATE + axis] = row[W + axis]
        row[ACCEL + axis] = 0.0


@njit
def fly_normalised(row, rate_x, rate_y, rate_z, thrust, params, dt, substeps):
    """Advance a row in place by `dt` s under body rates (rad/s, FLU) and normalised thrust (0..1) held constant."""
    h = dt / substeps
    c, lag = filter_coefficients(params, h), motor_lag(params, h)
    s, p = column(row), column(params)
    for _ in range(substeps):
        u = rate_step(s, 0, (rate_x, rate_y, rate_z), thrust, p, c, h)
        vehicle_step(s, 0, u, p, lag, h)


@njit
def normalised_thrust(thrust, params):
    """Command 0..1 for a mass-normalised collective thrust (m/s^2), by the NOMINAL hover thrust of the params row."""
    return min(1.0, max(0.0, thrust * params[HOVER_THRUST] / GRAVITY))


@njit
def fly(row, ctbr, params, dt, substeps):
    """Advance one vehicle row (ND,) in place by one control period of `dt` seconds, in `substeps` steps of physics.

    `ctbr` (4,): body rate FLU (rad/s), mass-normalised collective thrust (m/s^2). 0.01 s in 5 substeps is 500 Hz.
    """
    fly_normalised(row, ctbr[0], ctbr[1], ctbr[2], normalised_thrust(ctbr[3], params), params, dt, substeps)
