"""Pose of the board from tag corners: two planar starting points, refined by least squares, with their covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from kernel.jit import njit
from kernel.rotations import from_rotation_vector, to_matrix

_ITERATIONS = 12


@dataclass(frozen=True, slots=True)
class PoseFit:
    """Board in the optical frame: `R` (3, 3), `p` (3,) m, reprojection rms (px), and the covariance (6, 6): rotation
    about the board's axes (rad) first, then position in the optical frame (m). Residuals larger than the corners' own
    sigmas widen it."""

    R: np.ndarray
    p: np.ndarray
    rms: float
    covariance: np.ndarray


@njit
def _solve6(a, b):
    """Invert symmetric `a` (6, 6) in place by Gauss-Jordan and return a^-1 b; False if it is singular."""
    inverse = np.eye(6)
    for i in range(6):
        pivot = a[i, i]
        if not pivot > 1e-12:
            return False, b
        for j in range(6):
            a[i, j] /= pivot
            inverse[i, j] /= pivot
        for r in range(6):
            if r != i:
                f = a[r, i]
                for j in range(6):
                    a[r, j] -= f * a[i, j]
                    inverse[r, j] -= f * inverse[i, j]
    a[:] = inverse
    x = np.zeros(6)
    for i in range(6):
        for j in range(6):
            x[i] += inverse[i, j] * b[j]
    return True, x


@njit
def refine(points, pixels, sigmas, fx, fy, cx, cy, R, p, normal):
    """Gauss-Newton on the reprojection error, `R` (3, 3) and `p` (3,) in place, `normal` (6, 6) gets the covariance.

    `points` (n, 3) m in the board frame, `pixels` (n, 2) and their one-sigmas (n,) px. Returns the rms residual per
    corner (px), or -1 if a corner fell behind the camera or the problem is singular. Rotation steps are about the
    board's axes: R exp(w).
    """
    n = points.shape[0]
    J, scale = np.empty((2, 6)), np.ones(6)
    rms, misfit = -1.0, 0.0
    for iteration in range(_ITERATIONS):
        normal[:] = 0.0
        g, total, misfit = np.zeros(6), 0.0, 0.0
        for k in range(n):
            a, b, c = points[k, 0], points[k, 1], points[k, 2]
            x = R[0, 0] * a + R[0, 1] * b + R[0, 2] * c + p[0]
            y = R[1, 0] * a + R[1, 1] * b + R[1, 2] * c + p[1]
            z = R[2, 0] * a + R[2, 1] * b + R[2, 2] * c + p[2]
            if not z > 1e-3:
                return -1.0
            du, dv = pixels[k, 0] - (fx * x / z + cx), pixels[k, 1] - (fy * y / z + cy)
            weight = 1.0 / (sigmas[k] * sigmas[k])
            total += du * du + dv * dv
            misfit += weight * (du * du + dv * dv)
            J[0, 3], J[0, 4], J[0, 5] = fx / z, 0.0, -fx * x / (z * z)
            J[1, 3], J[1, 4], J[1, 5] = 0.0, fy / z, -fy * y / (z * z)
            for i in range(2):
                # Derivative along the board's axes, then cross with the point: d(R exp(w) X)/dw = -R [X]x
                j0 = J[i, 3] * R[0, 0] + J[i, 4] * R[1, 0] + J[i, 5] * R[2, 0]
                j1 = J[i, 3] * R[0, 1] + J[i, 4] * R[1, 1] + J[i, 5] * R[2, 1]
                j2 = J[i, 3] * R[0, 2] + J[i, 4] * R[1, 2] + J[i, 5] * R[2, 2]
                J[i, 0], J[i, 1], J[i, 2] = j2 * b - j1 * c, j0 * c - j2 * a, j1 * a - j0 * b
                e = du if i == 0 else dv
                for r in range(6):
                    g[r] += weight * J[i, r] * e
                    for s in range(6):
                        normal[r, s] += weight * J[i, r] * J[i, s]
        rms = math.sqrt(total / n)
        # Scale to unit diagonal: radians and metres differ by orders of magnitude
        for r in range(6):
            scale[r] = 1.0 / math.sqrt(max(normal[r, r], 1e-30))
        for r in range(6):
            g[r] *= scale[r]
            for s in range(6):
                normal[r, s] *= scale[r] * scale[s]
        good, step = _solve6(normal, g)
        if not good:
            return -1.0
        for r in range(6):
            step[r] *= scale[r]
            for s in range(6):
                normal[r, s] *= scale[r] * scale[s]
        largest = max(abs(step[0]), abs(step[1]), abs(step[2]))
        damp = min(1.0, 0.3 / max(largest, 1e-12))
        turn = to_matrix(from_rotation_vector(damp * step[0], damp * step[1], damp * step[2]))
        for i in range(3):
            r0, r1, r2 = R[i, 0], R[i, 1], R[i, 2]
            for j in range(3):
                R[i, j] = r0 * turn[0, j] + r1 * turn[1, j] + r2 * turn[2, j]
            p[i] += damp * step[3 + i]
        if largest < 1e-8 and iteration > 0:
            break
    normal *= max(1.0, misfit / (2 * n - 6))
    return rms


def fit_poses(
    points: np.ndarray,
    pixels: np.ndarray,
    sigmas: np.ndarray,
    matrix: np.ndarray,
    guess: tuple[np.ndarray, np.ndarray] | None = None,
) -> list[PoseFit]:
    """Poses that explain corners of a planar board, the lowest rms first; empty if none does.

    `points` (n, 3) m in the board frame with z = 0, `pixels` (n, 2) and their one-sigmas (n,), n >= 4; `matrix` the
    intrinsics. A planar target far away has two solutions, reflections of each other about the line of sight: both are
    refined, and so is `guess` (R (3, 3), p (3,) m), because at grazing views the closed form can miss the true one.
    """
    starts = [] if guess is None else [(guess[0].copy(), guess[1].copy())]
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(points, pixels, matrix, None, flags=cv2.SOLVEPNP_IPPE)
        starts += [(cv2.Rodrigues(r)[0], t.reshape(3).copy()) for r, t in zip(turns, shifts, strict=True)]
    except cv2.error:
        pass
    fits = []
    for R, p in starts:
        if not (np.isfinite(R).all() and np.isfinite(p).all()):
            continue
        covariance = np.empty((6, 6))
        rms = refine(points, pixels, sigmas, matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], R, p, covariance)
        if rms >= 0.0 and float(R[:, 2] @ p) < 0.0:
            fits.append(PoseFit(R, p, rms, covariance))
    return sorted(fits, key=lambda fit: fit.rms)
