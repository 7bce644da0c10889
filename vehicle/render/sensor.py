"""Effects of lens and sensor on a picture: vignetting, gain, shot and read noise, seeded by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kernel.jit import njit
from kernel.random import next_uint64

_NOISE_UNIT = 32.0  # the noise tile holds N(0, 1) in 1/32
_TILE = 1 << 20


@dataclass(frozen=True)
class Sensor:
    """A small global-shutter sensor; grey values in DN of 8 bits.

    `electrons_per_dn` sets the shot noise (a full well of about 10 000 e- over 255 DN gives 40), `read_noise` is in DN,
    `vignetting` the loss of light at the picture's corner, `point_spread` the lens's one-sigma blur in px.
    """

    gain: float = 1.0
    electrons_per_dn: float = 40.0
    read_noise: float = 0.8
    vignetting: float = 0.25
    point_spread: float = 0.7


def noise_tile(seed: int) -> np.ndarray:
    """A tile of standard normal noise in steps of 1/32, shape (2^20,) int8; rows of pictures are cut out of it."""
    draws = np.random.Generator(np.random.PCG64([seed, 0x5E])).standard_normal(_TILE, dtype=np.float32)
    return np.clip(np.rint(draws * _NOISE_UNIT), -127, 127).astype(np.int8)


def vignette(size: int, centre: float, corner_square: float, loss: float) -> np.ndarray:
    """Loss along one axis, (size,) float32: the loss at a pixel is the sum of its row's and its column's."""
    return (loss * (np.arange(size) - centre) ** 2 / corner_square).astype(np.float32)


@njit
def _expose_row(row, noise, loss, kept, gain, shot, read, out):
    """One row: light times vignetting and gain, noise of variance `shot` * light + `read`, to 8 bits."""
    for i in range(row.shape[0]):
        light = np.float32(row[i]) * (kept - loss[i]) * gain
        value = light + np.sqrt(light * shot + read) * np.float32(noise[i]) + np.float32(0.5)
        value = value if value > np.float32(0.0) else np.float32(0.0)
        value = value if value < np.float32(255.0) else np.float32(255.0)
        out[i] = np.uint8(np.int32(value))


@njit(nogil=True)
def expose(image, tile, column_loss, row_loss, gain, electrons_per_dn, read_noise, stream, out):
    """Picture of the light in `image` (uint8) into `out` (uint8, same shape); `stream` is the frame's random stream."""
    unit = np.float32(1.0 / (_NOISE_UNIT * _NOISE_UNIT))
    # Gain multiplies the noise too: at gain g a DN stands for 1/g as many electrons
    shot = np.float32(gain / electrons_per_dn) * unit
    read = np.float32(read_noise * read_noise * max(gain, 1.0)) * unit
    width = image.shape[1]
    span = np.uint64(tile.shape[0] - width)
    for v in range(image.shape[0]):
        start = np.int64(next_uint64(stream) % span)
        kept = np.float32(1.0) - row_loss[v]
        _expose_row(image[v], tile[start : start + width], column_loss, kept, np.float32(gain), shot, read, out[v])
