"""From the picture of a lens to the pinhole camera behind it, and back: points, and the picture of a simulated camera.

Pinhole pixels are those that a camera without distortion, with the same matrix, would have. A picture is never
undistorted: the corners that are found in it are.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np

from vehicle.camera.lens import Lens
from vehicle.camera.pinhole import Camera

_STOP = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 60, 1e-9)
_MARGIN = 0.05  # of the picture's pinhole rectangle: polynomials fold back into the picture beyond it
_MOST_GROWTH = 3.0  # of a side: a wider view cannot be drawn from one pinhole picture
_RIM = 64  # points along each edge
_SPARE = 2  # px around what is drawn


def undistorted(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Pinhole pixels of `points` ((..., 2) px of the picture)."""
    if not camera.lens.bends or not points.size:
        return points
    flat = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 1, 2)
    k, d = camera.matrix, np.array(camera.lens.coefficients)
    if camera.lens.model == "fisheye":
        found = cv2.fisheye.undistortPoints(flat, k, d, P=k, criteria=_STOP)
    else:
        found = cv2.undistortPoints(flat, k, d, P=k, criteria=_STOP)
    return found.reshape(points.shape)


def distorted(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Pixels of the picture where pinhole pixels `points` ((..., 2)) are seen.

    Points beyond the picture are moved to just outside it, where the lens's model still holds.
    """
    if not camera.lens.bends or not points.size:
        return points
    low, high = _rectangle(camera)
    spare = _MARGIN * (high - low)
    inside = np.clip(np.asarray(points, dtype=np.float64), low - spare, high + spare)
    rays = (inside.reshape(-1, 2) - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    return _bent(rays, camera).reshape(np.shape(points))


def edges(camera: Camera) -> tuple[float, float, float, float]:
    """Pinhole pixels of the picture's edges at their middles: left, right, upper, lower."""
    right, lower = camera.width - 0.5, camera.height - 0.5
    at = np.array([(-0.5, camera.cy), (right, camera.cy), (camera.cx, -0.5), (camera.cx, lower)])
    found = undistorted(at, camera)
    return float(found[0, 0]), float(found[1, 0]), float(found[2, 1]), float(found[3, 1])


def drawn_camera(camera: Camera) -> Camera:
    """The pinhole camera whose picture holds all that `camera` sees; `camera` itself without distortion.

    Raises ValueError where the lens sees too wide for one such picture.
    """
    if not camera.lens.bends:
        return camera
    low, high = _rectangle(camera)
    u0, v0 = (math.floor(x) - _SPARE for x in low)
    width, height = (2 * math.ceil((x - a + _SPARE + 1) / 2) for x, a in zip(high, (u0, v0), strict=True))
    if max(width / camera.width, height / camera.height) > _MOST_GROWTH:
        raise ValueError(f"a lens of model {camera.lens.model} sees too wide here to be simulated: {camera.lens}")
    return replace(camera, width=width, height=height, cx=camera.cx - u0, cy=camera.cy - v0, lens=Lens())


def picture_maps(camera: Camera, drawn: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel of `camera` lies in the picture of `drawn_camera`: x and y, (height, width) float32, px."""
    u, v = np.meshgrid(np.arange(float(camera.width)), np.arange(float(camera.height)))
    found = undistorted(np.stack([u, v], axis=-1), camera)
    x, y = found[..., 0] + drawn.cx - camera.cx, found[..., 1] + drawn.cy - camera.cy
    return x.astype(np.float32), y.astype(np.float32)


def _bent(rays: np.ndarray, camera: Camera) -> np.ndarray:
    """Pixels (n, 2) of rays (n, 2), x and y over z."""
    k, d = camera.matrix, np.array(camera.lens.coefficients)
    if camera.lens.model == "fisheye":
        return cv2.fisheye.distortPoints(rays.reshape(-1, 1, 2), k, d).reshape(-1, 2)
    ahead = np.column_stack((rays, np.ones(len(rays))))
    return cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), k, d)[0].reshape(-1, 2)


@lru_cache(maxsize=16)
def _rectangle(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Pinhole pixels (2,) of the least and the greatest corner of a rectangle that holds the picture."""
    u, v = np.linspace(-0.5, camera.width - 0.5, _RIM), np.linspace(-0.5, camera.height - 0.5, _RIM)
    rim = [np.column_stack((u, np.full(_RIM, y))) for y in (v[0], v[-1])]
    rim += [np.column_stack((np.full(_RIM, x), v)) for x in (u[0], u[-1])]
    found = undistorted(np.concatenate(rim), camera)
    return found.min(axis=0), found.max(axis=0)
