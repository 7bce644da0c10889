"""The quadrotor as a rigid body with four lagging motors: one vehicle is one (ND,) float64 row, world ENU, body FLU.

Paper App. "System Dynamics for Policy Training", eq. of the quadrotor, plus what the paper leaves to its simulator:
motor lag, linear drag, angular damping and saturation.
"""

from __future__ import annotations

import math

import numpy as np

from kernel import njit
from vehicle.airframe import (
    ANGULAR_DAMPING,
    ARM_X,
    ARM_Y,
    DRAG,
    GRAVITY,
    INERTIA,
    MASS,
    MIXER_ROLL_PITCH,
    MIXER_YAW,
    MOTOR_LAG,
    MOTOR_THRUST,
    YAW_TORQUE,
)
from vehicle.rotations import from_rotation_vector, multiply, normalise, rotate, rotate_back

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


@njit(inline="always")
def _relief(u0, u1, u2, u3, v0, v1, v2, v3, top):
    """Multiple of the direction v that takes the worst motors back into 0..top (sum of the worst below and above)."""
    low, high = 0.0, 0.0
    for u, v in ((u0, v0), (u1, v1), (u2, v2), (u3, v3)):
        k = 0.0
        if u < 0.0:
            k = -u / v
        elif u > top:
            k = (top - u) / v
        low, high = min(low, k), max(high, k)
    return low + high


@njit(inline="always")
def _desaturate(u0, u1, u2, u3, v0, v1, v2, v3, top):
    k = _relief(u0, u1, u2, u3, v0, v1, v2, v3, top)
    u0, u1, u2, u3 = u0 + k * v0, u1 + k * v1, u2 + k * v2, u3 + k * v3
    k = 0.5 * _relief(u0, u1, u2, u3, v0, v1, v2, v3, top)
    return u0 + k * v0, u1 + k * v1, u2 + k * v2, u3 + k * v3


@njit(inline="always")
def _lower(u0, u1, u2, u3):
    """Thrust taken back, never added, where motors ask for more than 1."""
    k = min(0.0, _relief(u0, u1, u2, u3, 1.0, 1.0, 1.0, 1.0, 1.0))
    u0, u1, u2, u3 = u0 + k, u1 + k, u2 + k, u3 + k
    k = min(0.0, 0.5 * _relief(u0, u1, u2, u3, 1.0, 1.0, 1.0, 1.0, 1.0))
    return u0 + k, u1 + k, u2 + k, u3 + k


@njit
def mix(roll, pitch, yaw, thrust, params):
    """Motor commands (4-tuple, 0..1) for torque set-points (-1..1, FLU) and collective thrust (0..1).

    PX4's order of sacrifice with MC_AIRMODE 0: thrust is reduced first (never raised), then roll, pitch, then yaw,
    which keeps 15 % authority at full thrust.
    """
    a, b = params[MIXER_ROLL_PITCH], params[MIXER_YAW]
    u0, u1 = thrust - a * (roll + pitch), thrust + a * (roll + pitch)
    u2, u3 = thrust + a * (roll - pitch), thrust - a * (roll - pitch)
    if not (min(u0, u1, u2, u3) >= 0.0 and max(u0, u1, u2, u3) <= 1.0):
        u0, u1, u2, u3 = _lower(u0, u1, u2, u3)
        u0, u1, u2, u3 = _desaturate(u0, u1, u2, u3, -a, a, a, -a, 1.0)
        u0, u1, u2, u3 = _desaturate(u0, u1, u2, u3, -a, a, -a, a, 1.0)
    u0, u1, u2, u3 = u0 - b * yaw, u1 - b * yaw, u2 + b * yaw, u3 + b * yaw
    if not (min(u0, u1, u2, u3) >= 0.0 and max(u0, u1, u2, u3) <= 1.0):
        u0, u1, u2, u3 = _desaturate(u0, u1, u2, u3, -b, -b, b, b, 1.15)
        u0, u1, u2, u3 = _lower(u0, u1, u2, u3)
    return min(1.0, max(0.0, u0)), min(1.0, max(0.0, u1)), min(1.0, max(0.0, u2)), min(1.0, max(0.0, u3))


@njit
def motor_lag(params, dt):
    """What motors keep of their thrust over `dt` s, and the mean of that over the step (2 floats).

    Thrust over the step is the lag's mean over it, so that a step's impulse does not depend on the step's length.
    """
    keep = math.exp(-dt / params[MOTOR_LAG])
    return keep, (1.0 - keep) * params[MOTOR_LAG] / dt


@njit
def vehicle_step(row, u0, u1, u2, u3, params, lag, dt):
    """Advance one vehicle row in place by `dt` s (2-4 ms) under the motor commands u0..u3 (0..1).

    `lag` comes from `motor_lag` for the same `dt`.
    """
    keep, mean = lag
    m0, m1, m2, m3 = row[MOTOR], row[MOTOR + 1], row[MOTOR + 2], row[MOTOR + 3]
    row[MOTOR], row[MOTOR + 1] = u0 + keep * (m0 - u0), u1 + keep * (m1 - u1)
    row[MOTOR + 2], row[MOTOR + 3] = u2 + keep * (m2 - u2), u3 + keep * (m3 - u3)
    row[COMMAND], row[COMMAND + 1], row[COMMAND + 2], row[COMMAND + 3] = u0, u1, u2, u3
    m0, m1, m2, m3 = u0 + mean * (m0 - u0), u1 + mean * (m1 - u1), u2 + mean * (m2 - u2), u3 + mean * (m3 - u3)

    full = params[MOTOR_THRUST]
    torque_x = params[ARM_Y] * full * (-m0 + m1 + m2 - m3)
    torque_y = params[ARM_X] * full * (-m0 + m1 - m2 + m3)
    torque_z = params[YAW_TORQUE] * full * (-m0 - m1 + m2 + m3)
    ix, iy, iz = params[INERTIA], params[INERTIA + 1], params[INERTIA + 2]
    damping = params[ANGULAR_DAMPING]
    wx, wy, wz = row[W], row[W + 1], row[W + 2]
    nx = wx + dt * (torque_x - (iz - iy) * wy * wz - damping * wx) / ix
    ny = wy + dt * (torque_y - (ix - iz) * wz * wx - damping * wy) / iy
    nz = wz + dt * (torque_z - (iy - ix) * wx * wy - damping * wz) / iz
    row[W], row[W + 1], row[W + 2] = nx, ny, nz

    q = (row[Q], row[Q + 1], row[Q + 2], row[Q + 3])
    air_x, air_y, air_z = rotate_back(q, row[V] - row[WIND], row[V + 1] - row[WIND + 1], row[V + 2] - row[WIND + 2])
    over_mass = 1.0 / params[MASS]
    fx = -params[DRAG] * air_x * over_mass
    fy = -params[DRAG + 1] * air_y * over_mass
    fz = (full * (m0 + m1 + m2 + m3) - params[DRAG + 2] * air_z) * over_mass
    row[F], row[F + 1], row[F + 2] = fx, fy, fz
    # The force acts along the attitude in the middle of the step: second order without a second evaluation.
    quarter = 0.25 * dt
    half_turn = from_rotation_vector(quarter * (wx + nx), quarter * (wy + ny), quarter * (wz + nz))
    q_mid = multiply(q, half_turn)
    ax, ay, az = rotate(q_mid, fx, fy, fz)
    az -= GRAVITY
    row[P] += dt * (row[V] + 0.5 * dt * ax)
    row[P + 1] += dt * (row[V + 1] + 0.5 * dt * ay)
    row[P + 2] += dt * (row[V + 2] + 0.5 * dt * az)
    row[V] += dt * ax
    row[V + 1] += dt * ay
    row[V + 2] += dt * az
    q = normalise(multiply(q_mid, half_turn))
    row[Q], row[Q + 1], row[Q + 2], row[Q + 3] = q[0], q[1], q[2], q[3]
