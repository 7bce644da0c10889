"""Search regions of a picture and their decimation, from the expected pose of the board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundcar.board.layout import Board
from vehicle.camera.distortion import distorted
from vehicle.camera.pinhole import Camera

_LARGE_SIDE = 40.0  # px after decimation that the large tag's shortest side keeps
_SMALL_SIDE = 18.0  # px, the same for a small tag
_SLACK = 0.2  # of the board's width in the picture, around the predicted board
_SLACK_PX = 20.0
_NEAR = 0.03  # m


@dataclass(frozen=True, slots=True)
class Region:
    """Part of a picture (ends exclusive) and the decimation to search it with."""

    u0: int
    v0: int
    u1: int
    v1: int
    decimate: float

    @property
    def work_px(self) -> float:
        """Pixels left after decimation: what a search costs."""
        return (self.u1 - self.u0) * (self.v1 - self.v0) / self.decimate**2


def predicted_region(camera: Camera, board: Board, R: np.ndarray, p: np.ndarray, doubt_px: float = 0.0) -> list[Region]:
    """Regions to search in turn until one shows a tag; empty if the expected pose is not in the picture.

    `doubt_px`: distance by which the board may be off, beyond the error of a pose predicted from the last picture.
    While the largest tag is wholly in the picture it alone decides the decimation; nearer, the smaller ones do, and
    their region is searched first: the board then fills the picture, and a search of all of it takes longest.
    """
    size = np.array([camera.width, camera.height], np.float64)
    points = board.corners @ R.T + p
    ahead = points[:, :, 2].min(axis=1) >= _NEAR
    pixels = points[:, :, :2] / np.maximum(points[:, :, 2:], _NEAR) * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    pixels = distorted(pixels, camera)
    low, high = pixels.min(axis=1), pixels.max(axis=1)
    seen = ahead & ((high >= -doubt_px) & (low <= size - 1 + doubt_px)).all(axis=1)
    shortest = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).min(axis=1)
    whole = ((low > 6) & (high < size - 7)).all(axis=1) & seen & board.is_large
    small = seen & ~board.is_large & ~whole.any()
    sides = [*shortest[whole] / _LARGE_SIDE, *shortest[small] / _SMALL_SIDE]
    decimate = float(np.clip(int(max(sides, default=1.0)), 1, 4))
    finer = [2.0 if decimate > 2.0 else 1.0] if decimate > 1.0 else []
    regions = [_around(pixels[small], size, doubt_px, decimate)]
    regions += [_around(pixels[seen], size, doubt_px, each) for each in (decimate, *finer)]
    return [region for region in regions if region is not None]


def _around(pixels: np.ndarray, size: np.ndarray, doubt_px: float, decimate: float) -> Region | None:
    """The region around corners ((n, 4, 2) px); None where too little of it is in the picture."""
    if not len(pixels):
        return None
    low, high = pixels.min(axis=(0, 1)), pixels.max(axis=(0, 1))
    slack = _SLACK_PX + _SLACK * float((high - low).max()) + doubt_px
    u0, v0 = (int(x) for x in np.maximum(low - slack, 0))
    u1, v1 = (int(x) for x in np.minimum(high + slack + 1, size))
    return None if u1 - u0 < 32 or v1 - v0 < 32 else Region(u0, v0, u1, v1, decimate)
