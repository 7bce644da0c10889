"""The solid objects around the board's face: slab, mast, car and their shadow, as flat-shaded convex faces."""

from __future__ import annotations

import math

import cv2
import numpy as np

from kernel.jit import njit
from vehicle.camera import camera_row

_NEAR = 0.02  # m
_SHIFT = 4  # sub-pixel bits of OpenCV's polygon fill
SUN = np.array([-0.35, 0.25, 0.90]) / np.linalg.norm([-0.35, 0.25, 0.90])

# A car of the Scout Mini's size (m): (x, y, z) centre on the ground frame and full extent, grey
_CAR_BOXES = (
    ((0.0, 0.0, 0.16), (0.61, 0.40, 0.17), 46.0),
    ((0.21, 0.24, 0.085), (0.17, 0.09, 0.17), 24.0),
    ((-0.21, 0.24, 0.085), (0.17, 0.09, 0.17), 24.0),
    ((0.21, -0.24, 0.085), (0.17, 0.09, 0.17), 24.0),
    ((-0.21, -0.24, 0.085), (0.17, 0.09, 0.17), 24.0),
)
_MAST = 0.06  # m, side of the mast between car and board
_MAST_GREY = 95.0
_SHADOW_GREYS = np.array([55.0, 55.0])
_FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
_SIGNS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_OUTWARD = np.array([-1, 1, -1, 1, -1, 1])[:, None]


def lambert(normal: np.ndarray) -> float:
    """Share of full light on a face with this outward normal (world): sky plus sun."""
    return 0.55 + 0.45 * max(0.0, float(normal @ SUN))


def _corners(centre, extent) -> np.ndarray:
    """Corners (8, 3) of a box in its own frame."""
    return np.asarray(centre) + _SIGNS * np.asarray(extent)


def _boxes(corners: np.ndarray, R: np.ndarray, origin: np.ndarray, greys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces (6 n, 4, 3) in the world and their greys (6 n,) of n boxes: `corners` (8 n, 3) and `greys` (n,) in a frame
    `R` (3, 3), `origin` (3,)."""
    faces = (corners @ R.T + origin).reshape(-1, 8, 3)[:, _FACES]
    normals = np.concatenate((R.T, R.T))[[0, 3, 1, 4, 2, 5]] * _OUTWARD
    light = np.array([lambert(normal) for normal in normals])
    return faces.reshape(-1, 4, 3), (greys[:, None] * light).ravel()


_CAR_CORNERS = np.concatenate([_corners(centre, extent) for centre, extent, _ in _CAR_BOXES])
_CAR_GREYS = np.array([*(grey for _, _, grey in _CAR_BOXES), _MAST_GREY])


def car_faces(board_p: np.ndarray, board_R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Car, mast and shadows under a board: faces (n, 4, 3) m in the world, back to front in kind, and greys (n,)."""
    heading = math.atan2(-board_R[0, 1], board_R[1, 1])
    c, s = math.cos(heading), math.sin(heading)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    origin = np.array([board_p[0], board_p[1], 0.0])
    lean = SUN[:2] / SUN[2]
    ground = np.array([[-0.34, -0.31], [0.34, -0.31], [0.34, 0.31], [-0.34, 0.31]]) @ R[:2, :2].T - 0.1 * lean
    face = board_p + (np.array([[-0.21, -0.21], [0.21, -0.21], [0.21, 0.21], [-0.21, 0.21]]) @ board_R[:, :2].T)
    shadows = np.full((2, 4, 3), 0.001)
    shadows[0, :, :2], shadows[1, :, :2] = ground + origin[:2], face[:, :2] - face[:, 2:] * lean
    top = board_p[2] - 0.02
    mast = _corners((0.0, 0.0, 0.5 * (top + 0.25)), (_MAST, _MAST, max(top - 0.25, 0.01)))
    faces, greys = _boxes(np.concatenate((_CAR_CORNERS, mast)), R, origin, _CAR_GREYS)
    return np.concatenate((shadows, faces)), np.concatenate((_SHADOW_GREYS, greys))


def slab_faces(
    board_p: np.ndarray, board_R: np.ndarray, size: float, thickness: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rim and dark back of the board (the face itself is drawn sample by sample): faces (5, 4, 3) and greys (5,)."""
    corners = _corners((0.0, 0.0, -thickness / 2), (size, size, thickness))
    faces, greys = _boxes(corners, board_R, board_p, np.array([60.0]))
    keep = [0, 1, 2, 3, 4]
    greys[4] = 32.0
    return faces[keep], greys[keep]


@njit
def _project_faces(faces, R, p, cam, step, points, counts):
    """Clip faces at the near plane and project them: `points` (n, 8, 2) px of the reduced picture, `counts` (n,)."""
    camera = np.empty((4, 3))
    for f in range(faces.shape[0]):
        for c in range(4):
            for i in range(3):
                camera[c, i] = 0.0
                for j in range(3):
                    camera[c, i] += R[j, i] * (faces[f, c, j] - p[j])
        n, area, inside = 0, 0.0, True
        for c in range(4):
            a, b = camera[c], camera[(c + 1) % 4]
            for part in range(2):
                if part == 0:
                    if a[2] < _NEAR:
                        continue
                    x, y, z = a[0], a[1], a[2]
                else:
                    if (a[2] < _NEAR) == (b[2] < _NEAR):
                        continue
                    k = (_NEAR - a[2]) / (b[2] - a[2])
                    x, y, z = a[0] + k * (b[0] - a[0]), a[1] + k * (b[1] - a[1]), _NEAR
                points[f, n, 0] = (cam[camera_row.FX] * x / z + cam[camera_row.CX] + 0.5) / step - 0.5
                points[f, n, 1] = (cam[camera_row.FY] * y / z + cam[camera_row.CY] + 0.5) / step - 0.5
                # OpenCV's fill takes 16.4 fixed point
                inside = inside and abs(points[f, n, 0]) < 30000.0 and abs(points[f, n, 1]) < 30000.0
                n += 1
        for i in range(n):
            j = (i + 1) % n
            area += points[f, i, 0] * points[f, j, 1] - points[f, j, 0] * points[f, i, 1]
        # Seen from outside a face runs counter-clockwise, which is a negative area where y points down
        counts[f] = n if n >= 3 and area < 0.0 and inside else 0


def draw_faces(
    image: np.ndarray, faces: np.ndarray, greys: np.ndarray, R: np.ndarray, p: np.ndarray, cam: np.ndarray, step: int
) -> None:
    """Fill the visible `faces` in order into `image` (uint8, one pixel for step x step of the camera's)."""
    points, counts = np.zeros((len(faces), 8, 2)), np.zeros(len(faces), np.int64)
    _project_faces(faces, R, p, cam, step, points, counts)
    fixed = np.rint(points * (1 << _SHIFT))
    for f in np.flatnonzero(counts):
        polygon = fixed[f, : counts[f]].astype(np.int32)
        cv2.fillConvexPoly(image, polygon, float(greys[f]), cv2.LINE_AA, _SHIFT)
