"""The paper's visual observation noise: truth of the board's pose in, a noisy pose out, as a kernel.

Source: paper App. "Description of the Visual Observation Noise Model" and its table of hyperparameters. Readings that
had to be chosen: S_dist = (k1 d)^k2 (the table swaps the two descriptions); "lateral" and "depth" are the x, y and z
axes of the optical frame; the biases are constant in the world (position) and in the board's frame (orientation).

The paper scales every sigma by one S_f. Here position lateral, position depth and rotation each have their own sigma
and k1..k5, so that one kernel also models the real detector, whose rotation error falls where its depth error
grows. The paper's set gives all three the same k.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.jit import njit
from kernel.random import normal
from kernel.rotations import multiply
from vehicle.camera import bias_row, detection_row, noise_row
from vehicle.camera.pinhole import camera_position, optical_axis, world_from_optical

# Errors of a detection from picture to picture beyond its corners' noise: the vehicle's own position (m) and the
# direction of the camera (rad). Errors that vary slowly are larger; the filter's random walks cover them.
ODOMETRY_SIGMA, POINTING_SIGMA = 0.003, 0.003


def paper_noise() -> np.ndarray:
    """The noise row of the paper's table: k = 1, 0.5, 2, 2, 0.15; 21 mm, 28 mm, 2 deg; bias 20 mm, 2 deg."""
    k = (1.0, 0.5, 2.0, 2.0, 0.15)
    deg = math.radians(2.0)
    return np.array([0.021, *k, 0.028, *k, deg, *k, 0.02, deg])


def measured_noise() -> np.ndarray:
    """The noise row fitted to what renderer and detector of this project give (benchmarks/bench_camera.py fit).

    Random views 0.15..9 m away, up to 82 deg of incidence, moving at about 2 m/s and 1.5 rad/s, 2 ms exposure;
    sigmas are 1.5 times the fit's, because the errors' tails are heavier than a Gaussian's. No bias: calibration and
    odometry are perfect there. One to two orders below the paper's set.
    """
    lateral = (4.0e-5, 1.0, 0.67, 9.7, 2.5, 1.9)
    depth = (1.0e-4, 1.0, 0.93, 4.9, 3.8, 2.35)
    rotation = (2.0e-3, 1.0, 0.13, 6.8, 0.0, 0.51)
    return np.array([*lateral, *depth, *rotation, 0.0, 0.0])


@njit
def viewing_condition(vehicle_p, vehicle_q, vehicle_v, board_p, normal_x, normal_y, normal_z, board_v, cam):
    """How the board is seen: (distance m, cos of angle to the optical axis, cos of incidence, relative speed m/s).

    The normal is the board's outward one in the world. Incidence is 0 when the board faces the camera.
    """
    x, y, z = camera_position(vehicle_p, vehicle_q, cam)
    dx, dy, dz = board_p[0] - x, board_p[1] - y, board_p[2] - z
    distance = max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
    ax, ay, az = optical_axis(vehicle_q, cam)
    cos_axis = (dx * ax + dy * ay + dz * az) / distance
    cos_incidence = -(dx * normal_x + dy * normal_y + dz * normal_z) / distance
    vx, vy, vz = vehicle_v[0] - board_v[0], vehicle_v[1] - board_v[1], vehicle_v[2] - board_v[2]
    return distance, cos_axis, cos_incidence, math.sqrt(vx * vx + vy * vy + vz * vz)


@njit
def channel_sigma(distance, cos_axis, cos_incidence, speed, noise, channel):
    """One-sigma of a channel (LATERAL, DEPTH or ROTATION): sigma * S_dist * S_axis * S_inc * S_vel."""
    s_dist = (noise[channel + noise_row.K1] * distance) ** noise[channel + noise_row.K2]
    s_axis = 1.0 + noise[channel + noise_row.K3] * (1.0 - cos_axis)
    s_inc = 1.0 + noise[channel + noise_row.K4] * (1.0 - cos_incidence)
    s_vel = 1.0 + noise[channel + noise_row.K5] * speed
    return noise[channel + noise_row.SIGMA] * s_dist * s_axis * s_inc * s_vel


@njit
def predicted_sigmas(distance, cos_axis, cos_incidence, speed, noise, scale):
    """One-sigmas (lateral m, depth m, rotation angle rad) under a viewing condition, times `scale`, without biases."""
    return (
        scale * channel_sigma(distance, cos_axis, cos_incidence, speed, noise, noise_row.LATERAL),
        scale * channel_sigma(distance, cos_axis, cos_incidence, speed, noise, noise_row.DEPTH),
        scale * channel_sigma(distance, cos_axis, cos_incidence, speed, noise, noise_row.ROTATION),
    )


@njit
def _random_rotation(sigma, rng):
    """Quaternion of a N(0, sigma^2) angle about a uniformly random axis (4 floats)."""
    half = 0.5 * sigma * normal(rng)
    x, y, z = normal(rng), normal(rng), normal(rng)
    s = math.sin(half) / max(math.sqrt(x * x + y * y + z * z), 1e-12)
    return math.cos(half), s * x, s * y, s * z


@njit
def draw_bias(noise, scale, rng, bias):
    """Draw an episode's systematic bias into `bias` (bias_row.DIM,); `rng` is a kernel stream."""
    for i in range(3):
        bias[bias_row.P + i] = scale * noise[noise_row.BIAS_POSITION] * normal(rng)
    turn = _random_rotation(scale * noise[noise_row.BIAS_ROTATION], rng)
    for i in range(4):
        bias[bias_row.Q + i] = turn[i]


@njit
def observe_board(vehicle_p, vehicle_q, vehicle_v, board_p, board_q, board_v, cam, noise, scale, bias, rng, out):
    """Write a noisy observation of the board into `out` (a detection row).

    `vehicle_p`, `vehicle_v`, `board_p`, `board_v`: (3,) world; `vehicle_q`, `board_q`: (4,) world from body / board;
    `cam`: camera row; `noise`: noise row; `scale` multiplies the random part (the bias was scaled when drawn);
    `bias`: bias row; `rng`: kernel stream. Position: p + R_world_optical S eps + p_b; orientation: q * dq * q_b.
    """
    w, x, y, z = board_q[0], board_q[1], board_q[2], board_q[3]
    nx, ny, nz = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
    d, ca, ci, v = viewing_condition(vehicle_p, vehicle_q, vehicle_v, board_p, nx, ny, nz, board_v, cam)
    lateral, depth, rotation = predicted_sigmas(d, ca, ci, v, noise, scale)
    ex, ey, ez = world_from_optical(vehicle_q, lateral * normal(rng), lateral * normal(rng), depth * normal(rng), cam)
    error = (ex, ey, ez)
    for i in range(3):
        out[detection_row.P + i] = board_p[i] + error[i] + bias[bias_row.P + i]
    turned = multiply(multiply((w, x, y, z), _random_rotation(rotation, rng)), bias[bias_row.Q : bias_row.DIM])
    for i in range(4):
        out[detection_row.Q + i] = turned[i]
    out[detection_row.SIGMA_LATERAL], out[detection_row.SIGMA_DEPTH] = lateral, depth
    out[detection_row.SIGMA_ROTATION] = rotation
