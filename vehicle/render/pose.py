"""Pose of the board in the camera at a time within the exposure, from poses and twists: kernels of the renderer.

A motion row is (13,): position (m, world), velocity (m/s, world), quaternion (world from body, w x y z), body rate
(rad/s, own body frame): the first thirteen numbers of a vehicle state row, and the same for the board.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.jit import njit
from kernel.rotations import integrate, to_matrix
from vehicle.camera import camera_row
from vehicle.quadrotor import state_row

MOTION_DIM = state_row.W + 3


def motion_row(position, orientation, velocity=(0.0, 0.0, 0.0), body_rate=(0.0, 0.0, 0.0)) -> np.ndarray:
    """A motion row from its parts. Raises ValueError unless all is finite and the quaternion has a length near 1."""
    row = np.array([*position, *velocity, *orientation, *body_rate], dtype=np.float64)
    if row.shape != (MOTION_DIM,) or not np.all(np.isfinite(row)):
        raise ValueError(f"a motion row needs 3 + 3 + 4 + 3 finite numbers, not {row}")
    length = np.linalg.norm(row[state_row.Q : state_row.W])
    if abs(length - 1.0) > 1e-3:
        raise ValueError(f"orientation must be a unit quaternion w x y z; this one has length {length:.4f}")
    row[state_row.Q : state_row.W] /= length
    return row


@njit
def _rotation_at(row, t):
    """World-from-body matrix (3, 3) of a motion row t seconds later, body rate held constant."""
    q, w = state_row.Q, state_row.W
    return to_matrix(integrate((row[q], row[q + 1], row[q + 2], row[q + 3]), row[w], row[w + 1], row[w + 2], t))


@njit
def camera_at(vehicle, t, cam, R, p):
    """Camera t seconds from a vehicle's motion row: `R` (3, 3) world from optical and `p` (3,) m, written in place."""
    body = _rotation_at(vehicle, t)
    c, s = math.cos(cam[camera_row.TILT]), math.sin(cam[camera_row.TILT])
    for i in range(3):
        p[i] = vehicle[state_row.P + i] + t * vehicle[state_row.V + i]
        p[i] += (
            body[i, 0] * cam[camera_row.OFFSET_X]
            + body[i, 1] * cam[camera_row.OFFSET_Y]
            + body[i, 2] * cam[camera_row.OFFSET_Z]
        )
        R[i, 0] = -body[i, 1]
        R[i, 1] = -s * body[i, 0] - c * body[i, 2]
        R[i, 2] = c * body[i, 0] - s * body[i, 2]


@njit
def board_in_camera_at(vehicle, board, t, cam, R, p):
    """Board's pose in the optical frame t seconds from the motion rows: `R` (3, 3), `p` (3,), written in place."""
    camera_R, camera_p, board_R = np.empty((3, 3)), np.empty(3), _rotation_at(board, t)
    camera_at(vehicle, t, cam, camera_R, camera_p)
    for i in range(3):
        p[i] = 0.0
        for j in range(3):
            p[i] += camera_R[j, i] * (board[state_row.P + j] + t * board[state_row.V + j] - camera_p[j])
            R[i, j] = camera_R[0, i] * board_R[0, j] + camera_R[1, i] * board_R[1, j] + camera_R[2, i] * board_R[2, j]


@njit
def face_from_pixel(R, p, cam, out):
    """Homography from pixel (u, v, 1) to the board's plane (x s, y s, s), s = 1 / depth > 0 in front; `out` (3, 3).

    Returns n . p: negative while the front face is seen, zero edge-on (then `out` is not usable).
    """
    # Columns of M = [r_x r_y p]; rows of its inverse are cross products over the determinant
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[0, i] = R[j, 1] * p[k] - R[k, 1] * p[j]
        out[1, i] = p[j] * R[k, 0] - p[k] * R[j, 0]
        out[2, i] = R[j, 0] * R[k, 1] - R[k, 0] * R[j, 1]
    det = out[2, 0] * p[0] + out[2, 1] * p[1] + out[2, 2] * p[2]
    if abs(det) < 1e-9:
        return 0.0
    for i in range(3):
        a, b, c = out[i, 0] / det, out[i, 1] / det, out[i, 2] / det
        out[i, 0], out[i, 1] = a / cam[camera_row.FX], b / cam[camera_row.FY]
        out[i, 2] = c - a * cam[camera_row.CX] / cam[camera_row.FX] - b * cam[camera_row.CY] / cam[camera_row.FY]
    return det
