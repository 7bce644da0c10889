"""The board's face in a picture: point samples spread over pixel and exposure, exact in perspective.

The face is a grid of modules small enough for the first-level cache, so a sample is one division and one look-up. For
each row and sample the pixels that fall on the face form one interval, found from linear inequalities: the inner loop
has no branch and compiles to vector code.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.jit import njit
from vehicle.camera import camera_row
from vehicle.render.pose import board_in_camera_at, face_from_pixel

MAX_SAMPLES = 32
_INSIDE = 1 << 16  # a face texel is its grey value plus this, so that one sum carries both brightness and coverage
_SHIFT = 20  # of a division by the samples' count as a product: exact for sums of up to MAX_SAMPLES grey values


def face_texture(bitmap: np.ndarray, black: float, white: float) -> np.ndarray:
    """Texels for `draw_face`: (modules + 2, modules + 2) int32, one module of padding for rounding at the rim."""
    grey = np.where(bitmap > 127, white, black)
    return np.ascontiguousarray(np.pad(np.rint(grey).astype(np.int32), 1, mode="edge") + _INSIDE)


@njit
def sample_offsets(count, out):
    """`count` offsets (x, y px in +-0.5, time in +-0.5 of the exposure) into `out` (MAX_SAMPLES, 3), each of zero mean.

    The R2 low-discrepancy sequence; time runs through the samples in another order than the offsets in the pixel.
    """
    for axis in range(3):
        mean = 0.0
        for k in range(count):
            if axis == 2:
                value = (k + 0.5) / count - 0.5
            else:
                value = (0.5 + (k + 1) * (0.7548776662466927 if axis == 0 else 0.5698402909980532)) % 1.0 - 0.5
            out[k, axis] = value
            mean += value / count
        for k in range(count):
            out[k, axis] -= mean


@njit
def face_box(vehicle, board, exposure, cam, half, width, height, box):
    """Pixels that the face covers during the exposure: `box` (4,) int64 = u0, v0, u1, v1, ends exclusive.

    Returns (longest motion of a corner in px, True if the front face is seen and in the picture).
    """
    R, p, h = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    start = np.empty((4, 2))
    u0, v0, u1, v1, blur, clipped, front = 1e9, 1e9, -1e9, -1e9, 0.0, False, False
    for moment in range(2):
        board_in_camera_at(vehicle, board, (moment - 0.5) * exposure, cam, R, p)
        front = front or face_from_pixel(R, p, cam, h) < 0.0
        # Walk the rim, cut at the near plane: a face that passes behind the camera still covers part of the picture
        for corner in range(4):
            x = half if corner in (0, 1) else -half
            y = half if corner in (0, 3) else -half
            qx, qy, qz = p[0] + R[0, 0] * x + R[0, 1] * y, p[1] + R[1, 0] * x + R[1, 1] * y, 0.0
            qz = p[2] + R[2, 0] * x + R[2, 1] * y
            if qz < 0.01:
                clipped = True
                continue
            u, v = cam[camera_row.FX] * qx / qz + cam[camera_row.CX], cam[camera_row.FY] * qy / qz + cam[camera_row.CY]
            u0, v0, u1, v1 = min(u0, u), min(v0, v), max(u1, u), max(v1, v)
            if moment == 1 and not clipped:
                blur = max(blur, math.hypot(u - start[corner, 0], v - start[corner, 1]))
            start[corner, 0], start[corner, 1] = u, v
    if clipped:
        u0, v0, u1, v1, blur = 0.0, 0.0, float(width), float(height), 32.0
    box[0], box[1] = max(0, math.floor(max(u0, -9.0)) - 1), max(0, math.floor(max(v0, -9.0)) - 1)
    box[2] = min(width, math.ceil(min(u1, width + 9.0)) + 2)
    box[3] = min(height, math.ceil(min(v1, height + 9.0)) + 2)
    return blur, front and box[0] < box[2] and box[1] < box[3]


@njit
def _cut(lo, hi, a, b):
    """The part of [lo, hi] where a + b i >= 0."""
    if b > 0.0:
        return max(lo, -a / b), hi
    if b < 0.0:
        return lo, min(hi, -a / b)
    return (lo, hi) if a >= 0.0 else (1.0, 0.0)


@njit
def _accumulate(acc, index, first, last, a, ax, b, bx, s, sx, texture):
    """Add the texels under pixels first..last-1 of a row; (a, b, s) + i (ax, bx, sx) are homogeneous texels."""
    # Two loops: the look-up may alias the sum, which would keep the arithmetic from becoming vector code
    columns, start = np.int32(texture.shape[1]), np.int32(first)
    for i in range(last - first):
        f = np.float32(np.int32(i) + start)
        inverse = np.float32(1.0) / (s + sx * f)
        column = np.int32((a + ax * f) * inverse)
        row = np.int32((b + bx * f) * inverse)
        index[i] = row * columns + column
    flat = texture.reshape(-1)
    for i in range(last - first):
        acc[first + i] += flat[np.uint32(index[i])]


@njit
def _blend(row, acc, count, reciprocal):
    """Mean of `count` samples a pixel, those beside the face showing what is in `row` (uint8) already; in place."""
    # A pixel that no sample hit comes out as it was: without a branch this is vector code
    half = count >> 1
    for i in range(row.shape[0]):
        behind = (count - (acc[i] >> 16)) * np.int32(row[i])
        row[i] = np.uint8((((acc[i] & 0xFFFF) + behind + half) * reciprocal) >> _SHIFT)


@njit(nogil=True)
def draw_face(image, vehicle, board, exposure, cam, half, texture, box, count):
    """Draw the face into `image` (height, width) uint8 inside `box`, averaging `count` samples a pixel."""
    modules = texture.shape[0] - 2
    scale = modules / (2.0 * half)
    offsets, h = np.empty((MAX_SAMPLES, 3)), np.empty((count, 3, 3))
    sample_offsets(count, offsets)
    R, p = np.empty((3, 3)), np.empty(3)
    for k in range(count):
        board_in_camera_at(vehicle, board, offsets[k, 2] * exposure, cam, R, p)
        det = face_from_pixel(R, p, cam, h[k])
        # To texels: column from y (left is +), row from x (up-slope is +), one texel of padding
        for j in range(3):
            x, y, s = h[k, 0, j], h[k, 1, j], h[k, 2, j]
            h[k, 0, j] = (half * s - y) * scale + s
            h[k, 1, j] = (half * s - x) * scale + s
            if det >= 0.0:
                h[k, 2, j] = 0.0
    width = box[2] - box[0]
    acc, index = np.empty(width, np.int32), np.empty(width, np.int32)
    reciprocal = np.int32((1 << _SHIFT) // count + 1)
    for v in range(box[1], box[3]):
        acc[:] = 0
        for k in range(count):
            du, dv = box[0] + offsets[k, 0], v + offsets[k, 1]
            ax, bx, sx = h[k, 0, 0], h[k, 1, 0], h[k, 2, 0]
            a = ax * du + h[k, 0, 1] * dv + h[k, 0, 2]
            b = bx * du + h[k, 1, 1] * dv + h[k, 1, 2]
            s = sx * du + h[k, 2, 1] * dv + h[k, 2, 2]
            lo, hi = _cut(0.0, width - 1.0, s - 1e-6, sx)
            lo, hi = _cut(lo, hi, a - s, ax - sx)
            lo, hi = _cut(lo, hi, (modules + 1) * s - a, (modules + 1) * sx - ax)
            lo, hi = _cut(lo, hi, b - s, bx - sx)
            lo, hi = _cut(lo, hi, (modules + 1) * s - b, (modules + 1) * sx - bx)
            if lo <= hi:
                _accumulate(
                    acc, index, math.ceil(lo), math.floor(hi) + 1, np.float32(a), np.float32(ax), np.float32(b),
                    np.float32(bx), np.float32(s), np.float32(sx), texture,
                )  # fmt: skip
        _blend(image[v, box[0] : box[2]], acc, np.int32(count), reciprocal)
