"""Where in the picture to look for the board, and how coarsely, given where it is expected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vehicle.board import Board
from vehicle.camera import Camera

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

    `doubt_px`: how far from there the board may be, beyond what a pose foretold from the last picture is wrong by.
    While the largest tag is wholly in the picture it alone decides the decimation; nearer, the smaller ones do, and
    where they are is looked first: the board fills the picture then, when there is least time.
    """
    size = np.array([camera.width, camera.height], np.float64)
    sides: list[tuple[float, float]] = []
    whole_large = False
    all_pixels: list[np.ndarray] = []
    small_pixels: list[np.ndarray] = []
    largest = max(tag.width for tag in board.tags)
    for tag in board.tags:
        points = tag.corners() @ R.T + p
        if points[:, 2].min() < _NEAR:
            continue
        pixels = points[:, :2] / points[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        if (pixels.max(axis=0) < -doubt_px).any() or (pixels.min(axis=0) > size - 1 + doubt_px).any():
            continue
        whole = bool((pixels > 6).all() and (pixels < size - 7).all())
        shortest = float(np.linalg.norm(pixels - np.roll(pixels, 1, axis=0), axis=1).min())
        all_pixels.append(pixels)
        if tag.width == largest:
            whole_large = whole
            if whole:
                sides.append((shortest, _LARGE_SIDE))
        elif not whole_large:
            small_pixels.append(pixels)
            sides.append((shortest, _SMALL_SIDE))
    coarse = max((side / needed for side, needed in sides), default=1.0)
    decimate = float(np.clip(int(coarse), 1, 4))
    finer = [2.0 if decimate > 2.0 else 1.0] if decimate > 1.0 else []
    regions = [_around(small_pixels, size, doubt_px, decimate)]
    regions += [_around(all_pixels, size, doubt_px, each) for each in (decimate, *finer)]
    return [region for region in regions if region is not None]


def _around(pixels: list[np.ndarray], size: np.ndarray, doubt_px: float, decimate: float) -> Region | None:
    """The region around corners ((n, 2) px each); None where too little of it is in the picture."""
    if not pixels:
        return None
    together = np.concatenate(pixels)
    low, high = together.min(axis=0), together.max(axis=0)
    slack = _SLACK_PX + _SLACK * float((high - low).max()) + doubt_px
    u0, v0 = (int(x) for x in np.maximum(low - slack, 0))
    u1, v1 = (int(x) for x in np.minimum(high + slack + 1, size))
    return None if u1 - u0 < 32 or v1 - v0 < 32 else Region(u0, v0, u1, v1, decimate)
