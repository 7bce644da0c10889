"""The quadrotor as a rigid body with four lagging motors: one vehicle is one (ND,) float64 row, world ENU, body FLU.

Paper App. "System Dynamics for Policy Training", eq. of the quadrotor, plus what the paper leaves to its simulator:
motor lag, linear drag, angular damping and saturation.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.jit import njit
from kernel.rotations import from_small_rotation, multiply, rotate, rotate_back
from vehicle.quadrotor.airframe import (
    ANGULAR_DAMPING,
    ARM_X,
    ARM_Y,
    DRAG,
    GRAVITY,
    INERTIA,
    MASS,
    MOTOR_LAG,
    MOTOR_THRUST,
    YAW_TORQUE,
)

# Indices of a vehicle row.
P = 0  # 3, position of the centre of mass, m, world
V = 3  # 3, velocity, m/s, world
Q = 6  # 4, world from body, w x y z
W = 10  # 3, body rate, rad/s
MOTOR = 13  # 4, thrust of a motor over its full thrust, 0..1
WIND = 17  # 3, velocity of the air, m/s, world: an input that stays until changed
F = 20  # 3, specific force (what an accelerometer shows) over the last substep, m/s^2, body
COMMAND = 23  # 4, motor commands of the last substep, 0..1
GYRO = 27  # 6, second-order low-pass of the body rate: two delay elements per axis
RATE = 33  # 3, filtered body rate of the last substep, rad/s
ACCEL = 36  # 3, filtered angular acceleration, rad/s^2
INTEGRAL = 39  # 3, integrator of the rate loop, torque set-point
TORQUE_YAW = 42  # filtered yaw torque set-point
HEADROOM_UP, HEADROOM_DOWN = 43, 46  # 3 each, 0 where the last allocation could not give more of that torque, else 1
ND = 49


def vehicle_row(
    position: tuple[float, float, float] | np.ndarray = (0.0, 0.0, 0.0),
    orientation: tuple[float, float, float, float] | np.ndarray = (1.0, 0.0, 0.0, 0.0),
    motor: float = 0.0,
) -> np.ndarray:
    """A row at rest at `position` (m, ENU) with all motors at `motor` (0..1; hover thrust to start in the air)."""
    row = np.zeros(ND)
    row[P : P + 3] = position
    row[Q : Q + 4] = orientation
    row[MOTOR : MOTOR + 4] = motor
    row[COMMAND : COMMAND + 4] = motor
    row[HEADROOM_UP : HEADROOM_DOWN + 3] = 1.0
    row[F + 2] = GRAVITY
    return row


@njit
def motor_lag(params, dt):
    """What motors keep of their thrust over `dt` s, and the mean of that over the step (2 floats).

    Thrust over the step is the lag's mean over it, so that a step's impulse does not depend on the step's length.
    """
    keep = math.exp(-dt / params[MOTOR_LAG])
    return keep, (1.0 - keep) * params[MOTOR_LAG] / dt


@njit(inline="always")
def column(row):
    """A row (N,) as the only column of an array (N, 1): one vehicle for the functions that step many side by side."""
    return row.reshape(-1, 1)


@njit(inline="always")
def vehicle_step(s, k, u, p, lag, dt):
    """Advance the vehicle in column k of `s` (ND, L) in place by `dt` s (2-4 ms) under motor commands `u` (4-tuple).

    `p` (NP, L): airframes. `lag` comes from `motor_lag` for the same airframe and `dt`. There is not one branch here:
    a loop over k becomes vector instructions (see `vehicle.quadrotor.batch`).
    """
    u0, u1, u2, u3 = u
    keep, mean = lag
    m0, m1, m2, m3 = s[MOTOR, k], s[MOTOR + 1, k], s[MOTOR + 2, k], s[MOTOR + 3, k]
    s[MOTOR, k], s[MOTOR + 1, k] = u0 + keep * (m0 - u0), u1 + keep * (m1 - u1)
    s[MOTOR + 2, k], s[MOTOR + 3, k] = u2 + keep * (m2 - u2), u3 + keep * (m3 - u3)
    s[COMMAND, k], s[COMMAND + 1, k], s[COMMAND + 2, k], s[COMMAND + 3, k] = u0, u1, u2, u3
    m0, m1, m2, m3 = u0 + mean * (m0 - u0), u1 + mean * (m1 - u1), u2 + mean * (m2 - u2), u3 + mean * (m3 - u3)

    full = p[MOTOR_THRUST, k]
    torque_x = p[ARM_Y, k] * full * (-m0 + m1 + m2 - m3)
    torque_y = p[ARM_X, k] * full * (-m0 + m1 - m2 + m3)
    torque_z = p[YAW_TORQUE, k] * full * (-m0 - m1 + m2 + m3)
    ix, iy, iz = p[INERTIA, k], p[INERTIA + 1, k], p[INERTIA + 2, k]
    damping = p[ANGULAR_DAMPING, k]
    wx, wy, wz = s[W, k], s[W + 1, k], s[W + 2, k]
    nx = wx + dt * (torque_x - (iz - iy) * wy * wz - damping * wx) / ix
    ny = wy + dt * (torque_y - (ix - iz) * wz * wx - damping * wy) / iy
    nz = wz + dt * (torque_z - (iy - ix) * wx * wy - damping * wz) / iz
    s[W, k], s[W + 1, k], s[W + 2, k] = nx, ny, nz

    q = (s[Q, k], s[Q + 1, k], s[Q + 2, k], s[Q + 3, k])
    vx, vy, vz = s[V, k], s[V + 1, k], s[V + 2, k]
    air_x, air_y, air_z = rotate_back(q, vx - s[WIND, k], vy - s[WIND + 1, k], vz - s[WIND + 2, k])
    over_mass = 1.0 / p[MASS, k]
    fx = -p[DRAG, k] * air_x * over_mass
    fy = -p[DRAG + 1, k] * air_y * over_mass
    fz = (full * (m0 + m1 + m2 + m3) - p[DRAG + 2, k] * air_z) * over_mass
    s[F, k], s[F + 1, k], s[F + 2, k] = fx, fy, fz
    # The force acts along the attitude in the middle of the step: second order without a second evaluation.
    quarter = 0.25 * dt
    half_turn = from_small_rotation(quarter * (wx + nx), quarter * (wy + ny), quarter * (wz + nz))
    q_mid = multiply(q, half_turn)
    ax, ay, az = rotate(q_mid, fx, fy, fz)
    az -= GRAVITY
    s[P, k] += dt * (vx + 0.5 * dt * ax)
    s[P + 1, k] += dt * (vy + 0.5 * dt * ay)
    s[P + 2, k] += dt * (vz + 0.5 * dt * az)
    s[V, k], s[V + 1, k], s[V + 2, k] = vx + dt * ax, vy + dt * ay, vz + dt * az
    q = multiply(q_mid, half_turn)
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    s[Q, k], s[Q + 1, k], s[Q + 2, k], s[Q + 3, k] = q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale
