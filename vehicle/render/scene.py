"""The solid objects around the board's face: slab, mast, car and their shadow, as flat-shaded convex faces."""

from __future__ import annotations

import math

import cv2
import numpy as np

from kernel.jit import njit
from vehicle.camera import camera_row

_NEAR = 0.02  # m
_SHIFT = 4  # sub-pixel bits of OpenCV's polygon fill
_MARGIN = 2.0  # px around the picture, into which the fill's soft edge does not reach
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
_SLAB_GREY, _BACK_GREY = 60.0, 32.0
_SHADOW_GREY = 55.0
_SHADOW = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_CAR_SHADOW, _BOARD_SHADOW = np.array([0.34, 0.31]), np.array([0.21, 0.21])  # m, half of each side
_CENTRES, _EXTENTS = (np.array([box[part] for box in _CAR_BOXES]) for part in (0, 1))
_GREYS = np.array([grey for _, _, grey in _CAR_BOXES])
# A box's corners as signs of half its extent; of each face, in the order -x, +x, -y, +y, -z, +z, the corners' numbers
_SIGNS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


@njit
def lambert(x, y, z):
    """Share of full light on a face with the outward normal (x, y, z) (world): sky plus sun."""
    return 0.55 + 0.45 * max(0.0, x * SUN[0] + y * SUN[1] + z * SUN[2])


@njit
def _add_box(faces, greys, first, centre, extent, R, origin, grey):
    """The six faces of a box (`centre`, `extent` (3,) m) in a frame `R` (3, 3), `origin` (3,), from row `first` on."""
    for f in range(6):
        axis, side = f // 2, 2.0 * (f % 2) - 1.0
        greys[first + f] = grey * lambert(side * R[0, axis], side * R[1, axis], side * R[2, axis])
        for c in range(4):
            k = _FACES[f, c]
            x = centre[0] + _SIGNS[k, 0] * extent[0]
            y = centre[1] + _SIGNS[k, 1] * extent[1]
            z = centre[2] + _SIGNS[k, 2] * extent[2]
            for i in range(3):
                faces[first + f, c, i] = R[i, 0] * x + R[i, 1] * y + R[i, 2] * z + origin[i]


@njit
def car_faces(board_p, board_R):
    """Car, mast and shadows under a board: faces (n, 4, 3) m in the world, back to front in kind, and greys (n,)."""
    boxes = _CENTRES.shape[0]
    faces, greys = np.empty((2 + 6 * (boxes + 1), 4, 3)), np.empty(2 + 6 * (boxes + 1))
    heading = math.atan2(-board_R[0, 1], board_R[1, 1])
    c, s = math.cos(heading), math.sin(heading)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    origin = np.array([board_p[0], board_p[1], 0.0])
    for k in range(4):
        x, y = _SHADOW[k, 0] * _CAR_SHADOW[0], _SHADOW[k, 1] * _CAR_SHADOW[1]
        u, v = _SHADOW[k, 0] * _BOARD_SHADOW[0], _SHADOW[k, 1] * _BOARD_SHADOW[1]
        height = board_p[2] + (board_R[2, 0] * u + board_R[2, 1] * v)
        for i in range(2):
            lean = SUN[i] / SUN[2]
            faces[0, k, i] = R[i, 0] * x + R[i, 1] * y - 0.1 * lean + origin[i]
            faces[1, k, i] = board_p[i] + (board_R[i, 0] * u + board_R[i, 1] * v) - height * lean
    faces[:2, :, 2], greys[:2] = 0.001, _SHADOW_GREY
    for k in range(boxes):
        _add_box(faces, greys, 2 + 6 * k, _CENTRES[k], _EXTENTS[k], R, origin, _GREYS[k])
    top = board_p[2] - 0.02
    centre = np.array([0.0, 0.0, 0.5 * (top + 0.25)])
    extent = np.array([_MAST, _MAST, max(top - 0.25, 0.01)])
    _add_box(faces, greys, 2 + 6 * boxes, centre, extent, R, origin, _MAST_GREY)
    return faces, greys


@njit
def slab_faces(board_p, board_R, size, thickness):
    """Rim and dark back of the board (the face itself is drawn sample by sample): faces (5, 4, 3) and greys (5,)."""
    faces, greys = np.empty((6, 4, 3)), np.empty(6)
    centre, extent = np.array([0.0, 0.0, -thickness / 2.0]), np.array([size, size, thickness])
    _add_box(faces, greys, 0, centre, extent, board_R, board_p, _SLAB_GREY)
    greys[4] = _BACK_GREY
    return faces[:5], greys[:5]


@njit
def _project_faces(faces, R, p, cam, step, width, height, fixed, counts):
    """Clip faces at the near plane and project them into a reduced picture of `width` by `height` px.

    `fixed` (n, 8, 2): corners in OpenCV's fixed point; `counts` (n,): their number, 0 for a face that does not show.
    """
    camera, points = np.empty((4, 3)), np.empty((8, 2))
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
                points[n, 0] = (cam[camera_row.FX] * x / z + cam[camera_row.CX] + 0.5) / step - 0.5
                points[n, 1] = (cam[camera_row.FY] * y / z + cam[camera_row.CY] + 0.5) / step - 0.5
                # OpenCV's fill takes 16.4 fixed point
                inside = inside and abs(points[n, 0]) < 30000.0 and abs(points[n, 1]) < 30000.0
                n += 1
        left, right, above, below = 1e9, -1e9, 1e9, -1e9
        for i in range(n):
            j = (i + 1) % n
            left, right = min(left, points[i, 0]), max(right, points[i, 0])
            above, below = min(above, points[i, 1]), max(below, points[i, 1])
            for axis in range(2):
                fixed[f, i, axis] = np.int32(np.rint(points[i, axis] * (1 << _SHIFT))) if inside else 0
            area += points[i, 0] * points[j, 1] - points[j, 0] * points[i, 1]
        near = right > -_MARGIN and left < width + _MARGIN and below > -_MARGIN and above < height + _MARGIN
        # Seen from outside a face runs counter-clockwise, which is a negative area where y points down
        counts[f] = n if n >= 3 and area < 0.0 and inside and near else 0


def draw_faces(
    image: np.ndarray, faces: np.ndarray, greys: np.ndarray, R: np.ndarray, p: np.ndarray, cam: np.ndarray, step: int
) -> None:
    """Fill the visible `faces` in order into `image` (uint8, one pixel for step x step of the camera's)."""
    fixed, counts = np.empty((len(faces), 8, 2), np.int32), np.empty(len(faces), np.int64)
    height, width = image.shape
    _project_faces(faces, R, p, cam, step, width, height, fixed, counts)
    for f in np.flatnonzero(counts).tolist():
        cv2.fillConvexPoly(image, fixed[f, : counts[f]], float(greys[f]), cv2.LINE_AA, _SHIFT)
