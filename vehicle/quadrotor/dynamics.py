"""The quadrotor as a rigid body with four lagging motors: one vehicle is one state row (vehicle.quadrotor.state_row).

Paper App. "System Dynamics for Policy Training", eq. of the quadrotor, plus what the paper leaves to its simulator:
motor lag, linear drag, angular damping and saturation.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.jit import njit
from kernel.rotations import from_small_rotation, multiply, rotate, rotate_back
from vehicle.quadrotor import airframe_row, state_row
from vehicle.quadrotor.airframe import GRAVITY


def vehicle_row(
    position: tuple[float, float, float] | np.ndarray = (0.0, 0.0, 0.0),
    orientation: tuple[float, float, float, float] | np.ndarray = (1.0, 0.0, 0.0, 0.0),
    motor: float = 0.0,
) -> np.ndarray:
    """A row at rest at `position` (m, ENU) with all motors at `motor` (0..1; hover thrust to start in the air)."""
    row = np.zeros(state_row.DIM)
    row[state_row.P : state_row.P + 3] = position
    row[state_row.Q : state_row.Q + 4] = orientation
    row[state_row.MOTOR : state_row.MOTOR + 4] = motor
    row[state_row.COMMAND : state_row.COMMAND + 4] = motor
    row[state_row.HEADROOM_UP : state_row.HEADROOM_DOWN + 3] = 1.0
    row[state_row.F + 2] = GRAVITY
    return row


@njit
def motor_lag(params, dt):
    """Share of their thrust deviation that motors keep after `dt` s, and its mean over the step (2 floats).

    Thrust over the step is the lag's mean over it, so that a step's impulse does not depend on the step's length.
    """
    keep = math.exp(-dt / params[airframe_row.MOTOR_LAG])
    return keep, (1.0 - keep) * params[airframe_row.MOTOR_LAG] / dt


@njit(inline="always")
def column(row):
    """A row (N,) as the only column of an array (N, 1): one vehicle for the functions that step many side by side."""
    return row.reshape(-1, 1)


@njit(inline="always")
def vehicle_step(s, k, u, p, lag, dt):
    """Advance column k of `s` (state_row.DIM, L) in place by `dt` s (2-4 ms) under motor commands `u` (4-tuple).

    `p` (airframe_row.DIM, L): airframe rows. `lag` comes from `motor_lag` for the same airframe and `dt`. Without a
    branch here, a loop over k becomes vector instructions (see `vehicle.quadrotor.batch`).
    """
    u0, u1, u2, u3 = u
    keep, mean = lag
    m0, m1, m2, m3 = (
        s[state_row.MOTOR, k],
        s[state_row.MOTOR + 1, k],
        s[state_row.MOTOR + 2, k],
        s[state_row.MOTOR + 3, k],
    )
    s[state_row.MOTOR, k], s[state_row.MOTOR + 1, k] = u0 + keep * (m0 - u0), u1 + keep * (m1 - u1)
    s[state_row.MOTOR + 2, k], s[state_row.MOTOR + 3, k] = u2 + keep * (m2 - u2), u3 + keep * (m3 - u3)
    s[state_row.COMMAND, k], s[state_row.COMMAND + 1, k], s[state_row.COMMAND + 2, k], s[state_row.COMMAND + 3, k] = (
        u0,
        u1,
        u2,
        u3,
    )
    m0, m1, m2, m3 = u0 + mean * (m0 - u0), u1 + mean * (m1 - u1), u2 + mean * (m2 - u2), u3 + mean * (m3 - u3)

    full = p[airframe_row.MOTOR_THRUST, k]
    torque_x = p[airframe_row.ARM_Y, k] * full * (-m0 + m1 + m2 - m3)
    torque_y = p[airframe_row.ARM_X, k] * full * (-m0 + m1 - m2 + m3)
    torque_z = p[airframe_row.YAW_TORQUE, k] * full * (-m0 - m1 + m2 + m3)
    ix, iy, iz = p[airframe_row.INERTIA, k], p[airframe_row.INERTIA + 1, k], p[airframe_row.INERTIA + 2, k]
    damping = p[airframe_row.ANGULAR_DAMPING, k]
    wx, wy, wz = s[state_row.W, k], s[state_row.W + 1, k], s[state_row.W + 2, k]
    nx = wx + dt * (torque_x - (iz - iy) * wy * wz - damping * wx) / ix
    ny = wy + dt * (torque_y - (ix - iz) * wz * wx - damping * wy) / iy
    nz = wz + dt * (torque_z - (iy - ix) * wx * wy - damping * wz) / iz
    s[state_row.W, k], s[state_row.W + 1, k], s[state_row.W + 2, k] = nx, ny, nz

    q = (s[state_row.Q, k], s[state_row.Q + 1, k], s[state_row.Q + 2, k], s[state_row.Q + 3, k])
    vx, vy, vz = s[state_row.V, k], s[state_row.V + 1, k], s[state_row.V + 2, k]
    air_x, air_y, air_z = rotate_back(
        q, vx - s[state_row.WIND, k], vy - s[state_row.WIND + 1, k], vz - s[state_row.WIND + 2, k]
    )
    over_mass = 1.0 / p[airframe_row.MASS, k]
    fx = -p[airframe_row.DRAG, k] * air_x * over_mass
    fy = -p[airframe_row.DRAG + 1, k] * air_y * over_mass
    fz = (full * (m0 + m1 + m2 + m3) - p[airframe_row.DRAG + 2, k] * air_z) * over_mass
    s[state_row.F, k], s[state_row.F + 1, k], s[state_row.F + 2, k] = fx, fy, fz
    # The force acts along the attitude in the middle of the step: second order without a second evaluation.
    quarter = 0.25 * dt
    half_turn = from_small_rotation(quarter * (wx + nx), quarter * (wy + ny), quarter * (wz + nz))
    q_mid = multiply(q, half_turn)
    ax, ay, az = rotate(q_mid, fx, fy, fz)
    az -= GRAVITY
    s[state_row.P, k] += dt * (vx + 0.5 * dt * ax)
    s[state_row.P + 1, k] += dt * (vy + 0.5 * dt * ay)
    s[state_row.P + 2, k] += dt * (vz + 0.5 * dt * az)
    s[state_row.V, k], s[state_row.V + 1, k], s[state_row.V + 2, k] = vx + dt * ax, vy + dt * ay, vz + dt * az
    q = multiply(q_mid, half_turn)
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    s[state_row.Q, k], s[state_row.Q + 1, k], s[state_row.Q + 2, k], s[state_row.Q + 3, k] = (
        q[0] * scale,
        q[1] * scale,
        q[2] * scale,
        q[3] * scale,
    )
