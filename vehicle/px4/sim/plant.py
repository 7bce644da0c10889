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
from vehicle.px4.sim.control import EST_P, EST_Q, EST_V, EST_W, LANDED, OUT_RATE, OUT_THRUST, control_step
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import GRAVITY
from vehicle.quadrotor.dynamics import column, motor_lag, vehicle_step
from vehicle.quadrotor.rate_control import filter_coefficients, rate_step

TICK_NS = 4_000_000

# Indices of a noise row: one-sigma and time constant (s) of the estimate's errors; white noise of sensors.
POS_SIGMA, POS_TAU, VEL_SIGMA, VEL_TAU, ATT_SIGMA, ATT_TAU, GYRO_SIGMA, ACCEL_SIGMA = range(8)
# Indices of an error row: correlated errors, then what external vision or its absence adds.
ERR_P, ERR_V, ERR_A = 0, 3, 6  # 3 each: m, m/s, rad (rotation vector, body)
BIAS_P, BIAS_V, BIAS_YAW = 9, 12, 15  # 3, 3, 1
BLIND = 16  # 1: no horizontal position, x and y stay where they were last known
KNOWN_X, KNOWN_Y = 17, 18
NERR = 19
# Indices of a situation row: what the body may do.
ARMED, GROUND, ATTACHED, RESTING = 0, 1, 2, 3  # 0/1, m (height at which the centre of mass rests), 0/1, 0/1 (result)
HEALTH = 4  # 4, what is left of each motor, 0..1
NS = 8
# Indices of a snapshot row, NED and FRD, relative to the local origin.
S_P, S_V, S_Q, S_EULER, S_W, S_ACC, S_GYRO = 0, 3, 6, 10, 13, 16, 19
NSNAP = 22


@njit
def _correlated(error, at, sigma, tau, stream, dt):
    keep = math.exp(-dt / tau)
    drive = sigma * math.sqrt(1.0 - keep * keep)
    for axis in range(3):
        error[at + axis] = keep * error[at + axis] + drive * normal(stream)


@njit
def estimate_step(row, est, error, noise, stream, dt):
    """The estimate (NE,) from the truth and errors that are first-order Gauss-Markov, plus biases and blindness."""
    _correlated(error, ERR_P, noise[POS_SIGMA], noise[POS_TAU], stream, dt)
    _correlated(error, ERR_V, noise[VEL_SIGMA], noise[VEL_TAU], stream, dt)
    _correlated(error, ERR_A, noise[ATT_SIGMA], noise[ATT_TAU], stream, dt)
    for axis in range(3):
        est[EST_P + axis] = row[state_row.P + axis] + error[ERR_P + axis] + error[BIAS_P + axis]
        est[EST_V + axis] = row[state_row.V + axis] + error[ERR_V + axis] + error[BIAS_V + axis]
        est[EST_W + axis] = row[state_row.W + axis] + noise[GYRO_SIGMA] * normal(stream)
    if error[BLIND] > 0.0:
        est[EST_P], est[EST_P + 1] = error[KNOWN_X], error[KNOWN_Y]
        est[EST_V], est[EST_V + 1] = 0.0, 0.0
    q = multiply(
        (row[state_row.Q], row[state_row.Q + 1], row[state_row.Q + 2], row[state_row.Q + 3]),
        from_rotation_vector(error[ERR_A], error[ERR_A + 1], error[ERR_A + 2]),
    )
    if error[BIAS_YAW] != 0.0:
        q = multiply(from_rotation_vector(0.0, 0.0, error[BIAS_YAW]), q)
    est[EST_Q], est[EST_Q + 1], est[EST_Q + 2], est[EST_Q + 3] = q[0], q[1], q[2], q[3]


@njit
def _stand_on_ground(row, ground):
    """The ground takes all motion and keeps the vehicle level at its heading."""
    row[state_row.P + 2] = ground
    for i in range(3):
        row[state_row.V + i] = 0.0
        row[state_row.W + i] = 0.0
        row[state_row.INTEGRAL + i] = 0.0
    q = from_euler(0.0, 0.0, yaw((row[state_row.Q], row[state_row.Q + 1], row[state_row.Q + 2], row[state_row.Q + 3])))
    row[state_row.Q], row[state_row.Q + 1], row[state_row.Q + 2], row[state_row.Q + 3] = q[0], q[1], q[2], q[3]
    row[state_row.F], row[state_row.F + 1], row[state_row.F + 2] = 0.0, 0.0, GRAVITY


@njit
def _carried(row, dt):
    """Held by the magnet: moves on with the board's last known motion until the board's next pose arrives."""
    for i in range(3):
        row[state_row.P + i] += dt * row[state_row.V + i]
        row[state_row.INTEGRAL + i] = 0.0
    q = integrate(
        (row[state_row.Q], row[state_row.Q + 1], row[state_row.Q + 2], row[state_row.Q + 3]),
        row[state_row.W],
        row[state_row.W + 1],
        row[state_row.W + 2],
        dt,
    )
    row[state_row.Q], row[state_row.Q + 1], row[state_row.Q + 2], row[state_row.Q + 3] = q[0], q[1], q[2], q[3]
    x, y, z = rotate_back(q, 0.0, 0.0, GRAVITY)
    row[state_row.F], row[state_row.F + 1], row[state_row.F + 2] = x, y, z


@njit
def tick(row, params, c, est, error, noise, stream, situation, dt, substeps):
    """Advance everything by `dt` s: vehicle row, control row, estimate row; see the index tables above."""
    estimate_step(row, est, error, noise, stream, dt)
    armed = situation[ARMED] > 0.0
    if armed:
        control_step(c, est, dt)
    else:
        for axis in range(3):
            c[OUT_RATE + axis] = 0.0
        c[OUT_THRUST] = 0.0
    h = dt / substeps
    k, lag = filter_coefficients(params, h), motor_lag(params, h)
    s, p = column(row), column(params)
    setpoint = (c[OUT_RATE], c[OUT_RATE + 1], c[OUT_RATE + 2])
    resting = False
    for _ in range(substeps):
        u = (0.0, 0.0, 0.0, 0.0)
        if armed:
            u0, u1, u2, u3 = rate_step(s, 0, setpoint, c[OUT_THRUST], p, k, h)
            u = (
                u0 * situation[HEALTH],
                u1 * situation[HEALTH + 1],
                u2 * situation[HEALTH + 2],
                u3 * situation[HEALTH + 3],
            )
        if situation[ATTACHED] > 0.0:
            px, py, pz, q0, q1, q2, q3 = (
                row[state_row.P],
                row[state_row.P + 1],
                row[state_row.P + 2],
                row[state_row.Q],
                row[state_row.Q + 1],
                row[state_row.Q + 2],
                row[state_row.Q + 3],
            )
            vx, vy, vz, wx, wy, wz = (
                row[state_row.V],
                row[state_row.V + 1],
                row[state_row.V + 2],
                row[state_row.W],
                row[state_row.W + 1],
                row[state_row.W + 2],
            )
            vehicle_step(s, 0, u, p, lag, h)  # for the motors' sake
            (
                row[state_row.P],
                row[state_row.P + 1],
                row[state_row.P + 2],
                row[state_row.Q],
                row[state_row.Q + 1],
                row[state_row.Q + 2],
                row[state_row.Q + 3],
            ) = px, py, pz, q0, q1, q2, q3
            (
                row[state_row.V],
                row[state_row.V + 1],
                row[state_row.V + 2],
                row[state_row.W],
                row[state_row.W + 1],
                row[state_row.W + 2],
            ) = vx, vy, vz, wx, wy, wz
            _carried(row, h)
        else:
            vehicle_step(s, 0, u, p, lag, h)
            resting = row[state_row.P + 2] <= situation[GROUND] and row[state_row.V + 2] <= 0.0
            if resting:
                _stand_on_ground(row, situation[GROUND])
        if c[LANDED] > 0.0:
            for axis in range(3):
                row[state_row.INTEGRAL + axis] = 0.0
    situation[RESTING] = 1.0 if resting else 0.0


@njit
def snapshot(row, est, noise, stream, origin_x, origin_y, origin_z, out):
    """What streams report, NED/FRD (NSNAP,): estimated position, velocity, attitude, Euler angles, rates; sensors."""
    out[S_P], out[S_P + 1], out[S_P + 2] = (
        est[EST_P + 1] - origin_y,
        est[EST_P] - origin_x,
        origin_z - est[EST_P + 2],
    )
    out[S_V], out[S_V + 1], out[S_V + 2] = est[EST_V + 1], est[EST_V], -est[EST_V + 2]
    q = swap_attitude((est[EST_Q], est[EST_Q + 1], est[EST_Q + 2], est[EST_Q + 3]))
    sign = 1.0 if q[0] >= 0.0 else -1.0
    for i in range(4):
        out[S_Q + i] = sign * q[i]
    roll, pitch, heading = to_euler(q)
    out[S_EULER], out[S_EULER + 1], out[S_EULER + 2] = roll, pitch, heading
    out[S_W], out[S_W + 1], out[S_W + 2] = est[EST_W], -est[EST_W + 1], -est[EST_W + 2]
    out[S_ACC] = row[state_row.F] + noise[ACCEL_SIGMA] * normal(stream)
    out[S_ACC + 1] = -row[state_row.F + 1] + noise[ACCEL_SIGMA] * normal(stream)
    out[S_ACC + 2] = -row[state_row.F + 2] + noise[ACCEL_SIGMA] * normal(stream)
    out[S_GYRO], out[S_GYRO + 1], out[S_GYRO + 2] = out[S_W], out[S_W + 1], out[S_W + 2]
