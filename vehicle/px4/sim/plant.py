"""One 4 ms tick of the software PX4 as a kernel: estimate, cascade, rate loop, physics, ground, magnet.

The flight itself is `rate_step` and `vehicle_step`, the same functions that training runs. The estimate is of the
tick's beginning: control needs it before the physics goes on.
"""

from __future__ import annotations

import math

from kernel.jit import njit
from kernel.random import normal
from kernel.rotations import (
    from_euler,
    from_rotation_vector,
    integrate,
    multiply,
    rotate_back,
    swap_attitude,
    to_euler,
    yaw,
)
from vehicle.px4.sim.cascade import control_step, quaternion_at
from vehicle.px4.sim.rows import control, estimate, estimate_error, estimate_noise, situation, snapshot
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import GRAVITY
from vehicle.quadrotor.dynamics import column, motor_lag, vehicle_step
from vehicle.quadrotor.rate_control import filter_coefficients, rate_step

TICK_NS = 4_000_000


@njit
def _correlated(error, at, noise, sigma, stream, dt):
    """One step of a first-order Gauss-Markov error (3 at `at`); `sigma` is its index in the noise row, tau the next."""
    keep = math.exp(-dt / noise[sigma + 1])
    drive = noise[sigma] * math.sqrt(1.0 - keep * keep)
    for axis in range(3):
        error[at + axis] = keep * error[at + axis] + drive * normal(stream)


@njit
def estimate_step(row, est, error, noise, stream, dt):
    """The estimate (LENGTH,) from the truth and errors that are first-order Gauss-Markov, plus biases and blindness."""
    _correlated(error, estimate_error.POSITION, noise, estimate_noise.POSITION_SIGMA, stream, dt)
    _correlated(error, estimate_error.VELOCITY, noise, estimate_noise.VELOCITY_SIGMA, stream, dt)
    _correlated(error, estimate_error.ATTITUDE, noise, estimate_noise.ATTITUDE_SIGMA, stream, dt)
    for axis in range(3):
        position = row[state_row.P + axis] + error[estimate_error.POSITION + axis]
        velocity = row[state_row.V + axis] + error[estimate_error.VELOCITY + axis]
        est[estimate.POSITION + axis] = position + error[estimate_error.POSITION_BIAS + axis]
        est[estimate.VELOCITY + axis] = velocity + error[estimate_error.VELOCITY_BIAS + axis]
        est[estimate.RATE + axis] = row[state_row.W + axis] + noise[estimate_noise.GYRO_SIGMA + axis] * normal(stream)
    if error[estimate_error.BLIND] > 0.0:
        est[estimate.POSITION] = error[estimate_error.KNOWN_X]
        est[estimate.POSITION + 1] = error[estimate_error.KNOWN_Y]
        est[estimate.VELOCITY], est[estimate.VELOCITY + 1] = 0.0, 0.0
    tilt = estimate_error.ATTITUDE
    q = multiply(quaternion_at(row, state_row.Q), from_rotation_vector(error[tilt], error[tilt + 1], error[tilt + 2]))
    if error[estimate_error.YAW_BIAS] != 0.0:
        q = multiply(from_rotation_vector(0.0, 0.0, error[estimate_error.YAW_BIAS]), q)
    for i in range(4):
        est[estimate.ATTITUDE + i] = q[i]


@njit
def _stand_on_ground(row, ground):
    """The ground stops all motion and holds the vehicle level at its heading."""
    row[state_row.P + 2] = ground
    for i in range(3):
        row[state_row.V + i] = 0.0
        row[state_row.W + i] = 0.0
        row[state_row.INTEGRAL + i] = 0.0
    q = from_euler(0.0, 0.0, yaw(quaternion_at(row, state_row.Q)))
    for i in range(4):
        row[state_row.Q + i] = q[i]
    row[state_row.F], row[state_row.F + 1], row[state_row.F + 2] = 0.0, 0.0, GRAVITY


@njit
def _carried(row, dt):
    """Held by the magnet: moves with the board's last known motion until the next pose of the board comes."""
    for i in range(3):
        row[state_row.P + i] += dt * row[state_row.V + i]
        row[state_row.INTEGRAL + i] = 0.0
    q = integrate(quaternion_at(row, state_row.Q), row[state_row.W], row[state_row.W + 1], row[state_row.W + 2], dt)
    for i in range(4):
        row[state_row.Q + i] = q[i]
    x, y, z = rotate_back(q, 0.0, 0.0, GRAVITY)
    row[state_row.F], row[state_row.F + 1], row[state_row.F + 2] = x, y, z


@njit
def body_substep(row, params, u, body, lag, h):
    """One substep of `h` s of the body under motor commands `u` (4-tuple, 0..1): in the air, held or on the ground.

    `lag` comes from `motor_lag` for the same airframe and `h`. Returns whether it rests on the ground.
    """
    s, p = column(row), column(params)
    if body[situation.ATTACHED] > 0.0:
        px, py, pz = row[state_row.P], row[state_row.P + 1], row[state_row.P + 2]
        q0, q1, q2, q3 = quaternion_at(row, state_row.Q)
        vx, vy, vz = row[state_row.V], row[state_row.V + 1], row[state_row.V + 2]
        wx, wy, wz = row[state_row.W], row[state_row.W + 1], row[state_row.W + 2]
        vehicle_step(s, 0, u, p, lag, h)  # advances the motors only
        row[state_row.P], row[state_row.P + 1], row[state_row.P + 2] = px, py, pz
        row[state_row.Q], row[state_row.Q + 1], row[state_row.Q + 2], row[state_row.Q + 3] = q0, q1, q2, q3
        row[state_row.V], row[state_row.V + 1], row[state_row.V + 2] = vx, vy, vz
        row[state_row.W], row[state_row.W + 1], row[state_row.W + 2] = wx, wy, wz
        _carried(row, h)
        return False
    vehicle_step(s, 0, u, p, lag, h)
    resting = row[state_row.P + 2] <= body[situation.GROUND] and row[state_row.V + 2] <= 0.0
    if resting:
        _stand_on_ground(row, body[situation.GROUND])
    return resting


@njit
def weakened(u, body):
    """Motor commands `u` (4-tuple) with what is left of each motor."""
    return (
        u[0] * body[situation.HEALTH],
        u[1] * body[situation.HEALTH + 1],
        u[2] * body[situation.HEALTH + 2],
        u[3] * body[situation.HEALTH + 3],
    )


@njit
def tick(row, params, c, est, error, noise, stream, body, dt, substeps):
    """Advance everything by `dt` s: vehicle row, control row, estimate row; see the index tables above."""
    estimate_step(row, est, error, noise, stream, dt)
    armed = body[situation.ARMED] > 0.0
    if armed:
        control_step(c, est, dt)
    else:
        for axis in range(3):
            c[control.OUT_RATE + axis] = 0.0
        c[control.OUT_THRUST] = 0.0
    h = dt / substeps
    k, lag = filter_coefficients(params, h), motor_lag(params, h)
    s, p = column(row), column(params)
    setpoint = (c[control.OUT_RATE], c[control.OUT_RATE + 1], c[control.OUT_RATE + 2])
    resting = False
    for _ in range(substeps):
        u = (0.0, 0.0, 0.0, 0.0)
        if armed:
            u = weakened(rate_step(s, 0, setpoint, c[control.OUT_THRUST], p, k, h), body)
        resting = body_substep(row, params, u, body, lag, h)
        if c[control.LANDED] > 0.0:
            for axis in range(3):
                row[state_row.INTEGRAL + axis] = 0.0
    body[situation.RESTING] = 1.0 if resting else 0.0


@njit
def body_tick(row, params, motors, body, dt, substeps):
    """Advance the body alone by `dt` s under motor commands held constant (`motors` (4,), 0..1)."""
    h = dt / substeps
    lag = motor_lag(params, h)
    u = weakened((motors[0], motors[1], motors[2], motors[3]), body)
    resting = False
    for _ in range(substeps):
        resting = body_substep(row, params, u, body, lag, h)
    body[situation.RESTING] = 1.0 if resting else 0.0


@njit
def fill_snapshot(row, est, noise, stream, origin_x, origin_y, origin_z, out):
    """Fill the snapshot row `out` from the estimate row, with the sensors' own noise; origin: PX4's local origin, m."""
    out[snapshot.POSITION] = est[estimate.POSITION + 1] - origin_y
    out[snapshot.POSITION + 1] = est[estimate.POSITION] - origin_x
    out[snapshot.POSITION + 2] = origin_z - est[estimate.POSITION + 2]
    out[snapshot.VELOCITY] = est[estimate.VELOCITY + 1]
    out[snapshot.VELOCITY + 1] = est[estimate.VELOCITY]
    out[snapshot.VELOCITY + 2] = -est[estimate.VELOCITY + 2]
    q = swap_attitude(quaternion_at(est, estimate.ATTITUDE))
    sign = 1.0 if q[0] >= 0.0 else -1.0
    for i in range(4):
        out[snapshot.ATTITUDE + i] = sign * q[i]
    roll, pitch, heading = to_euler(q)
    out[snapshot.EULER] = roll
    out[snapshot.EULER + 1] = pitch
    out[snapshot.EULER + 2] = heading
    out[snapshot.RATE] = est[estimate.RATE]
    out[snapshot.RATE + 1] = -est[estimate.RATE + 1]
    out[snapshot.RATE + 2] = -est[estimate.RATE + 2]
    out[snapshot.ACCELERATION] = row[state_row.F] + noise[estimate_noise.ACCEL_SIGMA] * normal(stream)
    out[snapshot.ACCELERATION + 1] = -row[state_row.F + 1] + noise[estimate_noise.ACCEL_SIGMA] * normal(stream)
    out[snapshot.ACCELERATION + 2] = -row[state_row.F + 2] + noise[estimate_noise.ACCEL_SIGMA] * normal(stream)
    for axis in range(3):
        out[snapshot.GYRO + axis] = out[snapshot.RATE + axis]
