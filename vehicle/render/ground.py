"""The ground and the sky: a tileable procedural texture, seen through a ray cast at reduced resolution.

The detector never needs the ground sharp, so half the resolution is enough and costs a quarter. Each run of pixels
reads the level of an averaging pyramid that suits its distance, so far ground does not alias.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from kernel.jit import njit
from vehicle.camera import camera_row

TEXEL = 0.01  # m
_SIDE = 1024  # texels; the pattern repeats after about ten metres
_LEVELS = 11  # down to one texel: the mean
_RUN = 32  # pixels that share one level of the pyramid
_SKY = 160.0  # DN at the horizon


def ground_pyramid(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Averaging pyramid of an asphalt-like texture: all levels end to end (uint8) and where each begins ((12,) int64).

    Level k is (1024 >> k) texels square, row by row.
    """
    rng = np.random.Generator(np.random.PCG64([seed, 0x6D]))
    texture = np.zeros((_SIDE, _SIDE), np.float32)
    for octave, weight in ((8, 9.0), (32, 9.0), (128, 8.0), (256, 8.0), (512, 10.0), (1024, 9.0)):
        coarse = rng.standard_normal((octave, octave)).astype(np.float32)
        wrapped = np.pad(coarse, 2, mode="wrap")
        fine = cv2.resize(wrapped, None, fx=_SIDE / octave, fy=_SIDE / octave, interpolation=cv2.INTER_CUBIC)
        margin = 2 * _SIDE // octave
        texture += weight * fine[margin : margin + _SIDE, margin : margin + _SIDE]
    # Light chippings in dark binder
    texture[rng.random((_SIDE, _SIDE)) > 0.975] += 45.0
    levels = [np.clip(texture + 108.0, 25.0, 215.0)]
    for _ in range(1, _LEVELS):
        side = len(levels[-1]) // 2
        levels.append(levels[-1].reshape(side, 2, side, 2).mean(axis=(1, 3)))
    begin = np.cumsum([0] + [level.size for level in levels])
    return np.concatenate([np.rint(level).astype(np.uint8).ravel() for level in levels]), begin


@njit
def _ground_run(out, index, first, last, x, xx, y, yx, s, sx, texture, side):
    """Pixels first..last-1 of a row, all below the horizon; (x, y, s) + i (xx, yx, sx) are homogeneous texels."""
    mask = np.int32(side - 1)
    # Truncation rounds towards zero: keep coordinates positive
    offset = np.float32(1 << 16)
    begin, row_length = np.int32(first), np.int32(side)
    for i in range(last - first):
        f = np.float32(np.int32(i) + begin)
        inverse = np.float32(1.0) / (s + sx * f)
        column = np.int32(offset + (x + xx * f) * inverse) & mask
        row = np.int32(offset + (y + yx * f) * inverse) & mask
        index[i] = row * row_length + column
    for i in range(last - first):
        out[first + i] = texture[np.uint32(index[i])]


@njit(nogil=True)
def draw_ground(out, R, p, cam, step, pyramid, begin):
    """Ground plane z = 0 and sky into `out` (h, w) uint8, one pixel for `step` x `step` of the camera's.

    `R` (3, 3) world from optical, `p` (3,) camera position (m). A camera at or below the ground sees a flat grey.
    """
    height, width = out.shape
    camera_height = p[2]
    if camera_height < 0.02:
        out[:] = 60
        return
    texels = camera_height / TEXEL
    index = np.empty(_RUN, np.int32)
    for v in range(height):
        ry = ((v + 0.5) * step - 0.5 - cam[camera_row.CY]) / cam[camera_row.FY]
        rx = (0.5 * step - 0.5 - cam[camera_row.CX]) / cam[camera_row.FX]
        dx = step / cam[camera_row.FX]
        # s = depth below the camera along the ray (positive: meets the ground); position = p + h * ray / s
        s0 = -(R[2, 0] * rx + R[2, 1] * ry + R[2, 2])
        x0 = R[0, 0] * rx + R[0, 1] * ry + R[0, 2]
        y0 = R[1, 0] * rx + R[1, 1] * ry + R[1, 2]
        sx, xx, yx = -R[2, 0] * dx, R[0, 0] * dx, R[1, 0] * dx
        px, py = p[0] / TEXEL, p[1] / TEXEL
        for start in range(0, width, _RUN):
            stop = min(width, start + _RUN)
            s_first, s_last = s0 + sx * start, s0 + sx * (stop - 1)
            if min(s_first, s_last) > 0.01:
                middle = 0.5 * (s_first + s_last)
                # Footprint of one pixel in texels: across the ray, stretched along it by grazing incidence
                footprint = texels / middle * dx / math.sqrt(middle)
                level = min(_LEVELS - 1, max(0, int(math.log2(max(footprint, 1.0)) + 0.5)))
                k = 1.0 / (1 << level)
                _ground_run(
                    out[v], index, start, stop,
                    np.float32(k * (texels * x0 + px * s0)), np.float32(k * (texels * xx + px * sx)),
                    np.float32(k * (texels * y0 + py * s0)), np.float32(k * (texels * yx + py * sx)),
                    np.float32(s0), np.float32(sx), pyramid[begin[level] : begin[level + 1]], _SIDE >> level,
                )  # fmt: skip
            else:
                for i in range(start, stop):
                    s = s0 + sx * i
                    # The ground's mean in the haze at the horizon, a sky that brightens upwards
                    out[v, i] = 112 if s > 0.0 else min(230, int(_SKY - 160.0 * s))


@njit
def _across(row, out):
    """A row at twice the resolution, times four: three parts of the nearer pixel and one of the next, (2 n,) uint16."""
    n, three = row.shape[0], np.uint16(3)
    for i in range(1, n - 1):
        near = np.uint16(row[i]) * three
        out[2 * i] = np.uint16(near + np.uint16(row[i - 1]))
        out[2 * i + 1] = np.uint16(near + np.uint16(row[i + 1]))
    for i, outer, inner, beside in ((0, 0, 1, 1), (n - 1, 2 * n - 1, 2 * n - 2, n - 2)):
        out[outer] = np.uint16(4) * np.uint16(row[i])
        out[inner] = np.uint16(row[i]) * three + np.uint16(row[beside])


@njit
def _down(near, far, out):
    for i in range(out.shape[0]):
        sixteenths = (np.uint16(near[i] * np.uint16(3)) >> np.uint16(2)) + (far[i] >> np.uint16(2))
        out[i] = np.uint8((sixteenths + np.uint16(2)) >> np.uint16(2))


@njit(nogil=True)
def doubled(image, out):
    """`image` (h, w) uint8, w at least 2, at twice the resolution into `out` (2 h, 2 w): bilinear, and rounded as
    OpenCV's `resize` does, in a quarter of its time."""
    height, width = image.shape
    rows = np.empty((3, 2 * width), np.uint16)
    _across(image[0], rows[0])
    rows[2, :] = rows[0]
    for v in range(height):
        above, here, below = rows[(v + 2) % 3], rows[v % 3], rows[(v + 1) % 3]
        if v + 1 < height:
            _across(image[v + 1], below)
        else:
            below[:] = here
        _down(here, above, out[2 * v])
        _down(here, below, out[2 * v + 1])
