"""PX4's body rate loop as a kernel, and `fly`: the loop, mixer, motors and rigid body over one control period.

`fly` is what training runs over thousands of rows and what the software PX4 runs behind its wire.
"""

from __future__ import annotations

import math

from kernel import njit
from vehicle.airframe import (
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
from vehicle.dynamics import (
    ACCEL,
    GYRO,
    HEADROOM_DOWN,
    HEADROOM_UP,
    INTEGRAL,
    RATE,
    TORQUE_YAW,
    W,
    mix,
    motor_lag,
    vehicle_step,
)

_I_FADE = math.radians(400.0)  # the integrator's gain falls to 0 at this rate error (PX4 RateControl)
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


@njit(inline="always")
def _axis(row, axis, setpoint, params, c, dt):
    """Torque set-point of one axis from its filtered rate; updates the axis' filters and integrator in place."""
    g = GYRO + 2 * axis
    delayed = row[W + axis] - c[3] * row[g] - c[4] * row[g + 1]
    rate = c[0] * delayed + c[1] * row[g] + c[2] * row[g + 1]
    row[g + 1], row[g] = row[g], delayed
    row[ACCEL + axis] += c[5] * ((rate - row[RATE + axis]) * c[7] - row[ACCEL + axis])
    row[RATE + axis] = rate
    error = setpoint - rate
    k = params[RATE_K + axis]
    torque = k * (params[RATE_P + axis] * error - params[RATE_D + axis] * row[ACCEL + axis]) + row[INTEGRAL + axis]
    wound = error
    if (error > 0.0 and row[HEADROOM_UP + axis] == 0.0) or (error < 0.0 and row[HEADROOM_DOWN + axis] == 0.0):
        wound = 0.0
    fade = max(0.0, 1.0 - (wound / _I_FADE) ** 2)
    integral = row[INTEGRAL + axis] + fade * k * params[RATE_I + axis] * wound * dt
    limit = params[RATE_LIMIT_I + axis]
    row[INTEGRAL + axis] = min(limit, max(-limit, integral))
    return min(1.0, max(-1.0, torque))


@njit(inline="always")
def _note_headroom(row, axis, asked, given):
    row[HEADROOM_UP + axis] = 0.0 if asked > given + _SLACK else 1.0
    row[HEADROOM_DOWN + axis] = 0.0 if asked < given - _SLACK else 1.0


@njit
def rate_step(row, rate_x, rate_y, rate_z, thrust, params, c, dt):
    """One run of the rate loop and mixer: motor commands (4-tuple, 0..1) for body rates (rad/s, FLU) and thrust (0..1).

    Updates the filters and integrators in `row`; `c` comes from `filter_coefficients` for the same `dt`. A rate that is
    NaN means "keep the present rate", as for PX4.
    """
    roll = _axis(row, 0, row[RATE] if math.isnan(rate_x) else rate_x, params, c, dt)
    pitch = _axis(row, 1, row[RATE + 1] if math.isnan(rate_y) else rate_y, params, c, dt)
    raw_yaw = _axis(row, 2, row[RATE + 2] if math.isnan(rate_z) else rate_z, params, c, dt)
    row[TORQUE_YAW] += c[6] * (raw_yaw - row[TORQUE_YAW])
    yaw = row[TORQUE_YAW]
    u0, u1, u2, u3 = mix(roll, pitch, yaw, min(1.0, max(0.0, thrust)), params)
    a, b = 0.25 / params[MIXER_ROLL_PITCH], 0.25 / params[MIXER_YAW]
    _note_headroom(row, 0, roll, a * (-u0 + u1 + u2 - u3))
    _note_headroom(row, 1, pitch, a * (-u0 + u1 - u2 + u3))
    _note_headroom(row, 2, yaw, b * (-u0 - u1 + u2 + u3))
    return u0, u1, u2, u3


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
    for _ in range(substeps):
        u0, u1, u2, u3 = rate_step(row, rate_x, rate_y, rate_z, thrust, params, c, h)
        vehicle_step(row, u0, u1, u2, u3, params, lag, h)


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
