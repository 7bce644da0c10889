"""PX4's body rate loop as a kernel, and `fly`: the loop, mixer, motors and rigid body over one control period.

`fly` is what training runs over thousands of rows and what the software PX4 runs behind its wire.
"""

from __future__ import annotations

import math

from kernel.clip import clip
from kernel.jit import njit
from vehicle.quadrotor import airframe_row, command_row, state_row
from vehicle.quadrotor.airframe import GRAVITY
from vehicle.quadrotor.dynamics import column, motor_lag, vehicle_step
from vehicle.quadrotor.mixer import mix

_PER_FADE = 1.0 / math.radians(400.0)  # the integrator's gain falls to 0 at this rate error (PX4 RateControl)
_SLACK = 1e-3  # of the torque set-point: below it an allocation counts as achieved


@njit
def filter_coefficients(params, dt):
    """Coefficients (8-tuple) of the loop's filters at substep `dt`: gyro biquad b0 b1 b2 a1 a2, d-gyro, yaw, 1/dt."""
    cutoff = params[airframe_row.GYRO_CUTOFF]
    if cutoff * dt < 0.45:
        c = math.tan(math.pi * cutoff * dt)
        a0 = 1.0 + 2.0 * math.cos(0.25 * math.pi) * c + c * c  # Butterworth, second order
        b0 = c * c / a0
        b1, b2 = 2.0 * b0, b0
        a1, a2 = 2.0 * (c * c - 1.0) / a0, (1.0 - 2.0 * math.cos(0.25 * math.pi) * c + c * c) / a0
    else:  # too near Nyquist to filter
        b0, b1, b2, a1, a2 = 1.0, 0.0, 0.0, 0.0, 0.0
    alpha = dt / (dt + 1.0 / (2.0 * math.pi * params[airframe_row.DGYRO_CUTOFF]))
    yaw_alpha = 1.0
    if params[airframe_row.YAW_TORQUE_CUTOFF] > 0.0:
        yaw_alpha = dt / (dt + 1.0 / (2.0 * math.pi * params[airframe_row.YAW_TORQUE_CUTOFF]))
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
    return clip(torque, -1.0, 1.0), clip(integral, -limit, limit)


@njit(inline="always")
def _axis(s, k, axis, setpoint, p, c, dt):
    """Torque set-point of one axis from its filtered rate; updates the axis' filters and integrator in place."""
    g = state_row.GYRO + 2 * axis
    g0, g1 = s[g, k], s[g + 1, k]
    delayed = s[state_row.W + axis, k] - c[3] * g0 - c[4] * g1
    rate = c[0] * delayed + c[1] * g0 + c[2] * g1
    s[g + 1, k], s[g, k] = g0, delayed
    accel = s[state_row.ACCEL + axis, k]
    accel += c[5] * ((rate - s[state_row.RATE + axis, k]) * c[7] - accel)
    s[state_row.ACCEL + axis, k], s[state_row.RATE + axis, k] = accel, rate
    torque, s[state_row.INTEGRAL + axis, k] = _law(
        rate,
        accel,
        s[state_row.INTEGRAL + axis, k],
        setpoint,
        s[state_row.HEADROOM_UP + axis, k],
        s[state_row.HEADROOM_DOWN + axis, k],
        (
            p[airframe_row.RATE_K + axis, k],
            p[airframe_row.RATE_P + axis, k],
            p[airframe_row.RATE_I + axis, k],
            p[airframe_row.RATE_D + axis, k],
            p[airframe_row.RATE_LIMIT_I + axis, k],
        ),
        dt,
    )
    return torque


@njit(inline="always")
def torques(s, k, setpoint, p, c, dt):
    """Torque set-points (roll, pitch, yaw; -1..1) for body rates (rad/s), column k of `s` (state_row.DIM, L).

    One run of the rate loop; updates its filters and integrators. `p` (airframe_row.DIM, L): airframe rows; `c` comes
    from `filter_coefficients` for the same airframe and `dt`. No branch, as in `dynamics.vehicle_step`.
    """
    roll = _axis(s, k, 0, setpoint[0], p, c, dt)
    pitch = _axis(s, k, 1, setpoint[1], p, c, dt)
    raw_yaw = _axis(s, k, 2, setpoint[2], p, c, dt)
    yaw = s[state_row.TORQUE_YAW, k]
    yaw += c[6] * (raw_yaw - yaw)
    s[state_row.TORQUE_YAW, k] = yaw
    return roll, pitch, yaw


@njit(forceinline=True)
def _headroom(asked, given):
    """(up, down): 0 where more, or less, of a torque was asked than the motors could give."""
    return 0.0 if asked > given + _SLACK else 1.0, 0.0 if asked < given - _SLACK else 1.0


@njit(inline="always")
def allocate(s, k, torque, thrust, p):
    """Motor commands (4-tuple, 0..1) within the motors' limits; records which torques could not be reached."""
    roll, pitch, yaw = torque
    a, b = p[airframe_row.MIXER_ROLL_PITCH, k], p[airframe_row.MIXER_YAW, k]
    u0, u1, u2, u3 = mix(roll, pitch, yaw, thrust, a, b)
    a, b = 0.25 / a, 0.25 / b
    s[state_row.HEADROOM_UP, k], s[state_row.HEADROOM_DOWN, k] = _headroom(roll, a * (-u0 + u1 + u2 - u3))
    s[state_row.HEADROOM_UP + 1, k], s[state_row.HEADROOM_DOWN + 1, k] = _headroom(pitch, a * (-u0 + u1 - u2 + u3))
    s[state_row.HEADROOM_UP + 2, k], s[state_row.HEADROOM_DOWN + 2, k] = _headroom(yaw, b * (-u0 - u1 + u2 + u3))
    return u0, u1, u2, u3


@njit(inline="always")
def rate_step(s, k, setpoint, thrust, p, c, dt):
    """One run of the rate loop and mixer for column k of `s` (state_row.DIM, L): motor commands (4-tuple, 0..1).

    `setpoint`: body rates (3-tuple, rad/s, FLU), NaN means "keep the present rate", as for PX4; `thrust` 0..1.
    """
    return allocate(s, k, torques(s, k, setpoint, p, c, dt), clip(thrust, 0.0, 1.0), p)


@njit
def reset_rate_control(row):
    """Reset the loop's integrators and filters for a body rate of 0 (motors stopped)."""
    for i in range(state_row.GYRO, state_row.TORQUE_YAW + 1):
        row[i] = 0.0
    for i in range(state_row.HEADROOM_UP, state_row.HEADROOM_DOWN + 3):
        row[i] = 1.0


@njit
def settle_filters(row, params, dt):
    """Set the gyro filters to the steady state of the row's present body rate (for starts in flight)."""
    c = filter_coefficients(params, dt)
    for axis in range(3):
        settled = row[state_row.W + axis] / (1.0 + c[3] + c[4])
        row[state_row.GYRO + 2 * axis], row[state_row.GYRO + 2 * axis + 1] = settled, settled
        row[state_row.RATE + axis] = row[state_row.W + axis]
        row[state_row.ACCEL + axis] = 0.0


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
    """Command 0..1 for a mass-normalised collective thrust (m/s^2), by the nominal hover thrust of the airframe row."""
    return clip(thrust * params[airframe_row.HOVER_THRUST] / GRAVITY, 0.0, 1.0)


@njit
def fly(row, ctbr, params, dt, substeps):
    """Advance one state row in place by one control period of `dt` seconds, in `substeps` steps of physics.

    `ctbr`: a command row (vehicle.quadrotor.command_row): body rates (rad/s, FLU), mass-normalised thrust (m/s^2). 0.01
    s in 5 substeps is 500 Hz.
    """
    thrust = normalised_thrust(ctbr[command_row.THRUST], params)
    at = command_row.RATE
    fly_normalised(row, ctbr[at], ctbr[at + 1], ctbr[at + 2], thrust, params, dt, substeps)
