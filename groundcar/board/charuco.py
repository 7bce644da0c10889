"""The ChArUco board that cameras are calibrated with: a chessboard with a marker in each white square.

8 x 8 squares of 22 mm: it fits on A4. Its markers are of another family than the tags of the board that is perched on.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from groundcar.board.printing import Sheet

SQUARES = 8
SQUARE = 0.022  # m; a calibration does not depend on it
_SQUARE_MODULES, _MARKER_MODULES = 9, 7  # a 5 x 5 marker with its border is 7 modules wide


@cache
def charuco_board() -> cv2.aruco.CharucoBoard:
    """The board as OpenCV's detector takes it; lengths in m."""
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    marker = SQUARE * _MARKER_MODULES / _SQUARE_MODULES
    return cv2.aruco.CharucoBoard((SQUARES, SQUARES), SQUARE, marker, markers)


@cache
def charuco_bitmap() -> np.ndarray:
    """The face, (72, 72) uint8, 0 black or 255 white, one pixel a module."""
    side = SQUARES * _SQUARE_MODULES
    face = charuco_board().generateImage((side, side), marginSize=0, borderBits=1)
    face.setflags(write=False)
    return face


def charuco_sheet() -> Sheet:
    """The board to print."""
    return Sheet(charuco_bitmap(), SQUARE / _SQUARE_MODULES)
