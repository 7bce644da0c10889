"""Intrinsics and distortion of a camera from pictures of the ChArUco board (groundcar/board/charuco.py)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from groundcar.board.charuco import charuco_board
from vehicle.camera.lens import MODELS, Lens

LEAST_VIEWS = 8
_LEAST_CORNERS = 8  # of one picture; fewer do not determine a view
_CELLS = (8, 5)  # of the picture, to tell its coverage
_STOP = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-10)


class CalibrationError(ValueError):
    """Pictures that no calibration can be made of; the text says why and what to do."""


@dataclass(frozen=True)
class View:
    """The corners found in one picture: `board` (n, 3) m, `corners` (n, 2) px."""

    board: np.ndarray
    corners: np.ndarray


@dataclass(frozen=True)
class Calibrated:
    """A camera's calibration: px, pixel centres at integers.

    `sigma`: one-sigma of fx, fy, cx, cy (px), as the scatter of the corners tells. `rms`: reprojection error, px.
    `coverage`: share of the picture's 8 x 5 cells in which a corner was seen.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    lens: Lens
    sigma: tuple[float, float, float, float]
    rms: float
    coverage: float
    views: int
    corners: int


def find_corners(pixels: np.ndarray) -> View | None:
    """The board's corners in a picture ((height, width) uint8); None if too few are seen."""
    found, ids, _, _ = cv2.aruco.CharucoDetector(charuco_board()).detectBoard(pixels)
    if ids is None or len(ids) < _LEAST_CORNERS:
        return None
    known = np.asarray(charuco_board().getChessboardCorners(), dtype=np.float64)
    return View(known[np.asarray(ids, dtype=np.int64).ravel()], np.asarray(found, dtype=np.float64).reshape(-1, 2))


def calibrate(views: Iterable[View], size: tuple[int, int], model: str) -> Calibrated:
    """The calibration of distortion `model` from `views` of pictures of `size` (width, height).

    Raises CalibrationError for too few views, and for views that determine no camera (all of one pose).
    """
    views = list(views)
    if len(views) < LEAST_VIEWS:
        raise CalibrationError(
            f"the board was found in {len(views)} pictures, {LEAST_VIEWS} are the least: more pictures, with the whole "
            "board sharp in them"
        )
    boards = [view.board[:, None] for view in views]
    corners = [view.corners[:, None] for view in views]
    try:
        if model == "fisheye":
            flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
            rows = [part.reshape(1, -1, 3) for part in boards], [part.reshape(1, -1, 2) for part in corners]
            _, k, d, turns, places = cv2.fisheye.calibrate(
                *rows, size, np.zeros((3, 3)), np.zeros((4, 1)), flags=flags, criteria=_STOP
            )
        else:
            flags = {"pinhole": 0, "rational": cv2.CALIB_RATIONAL_MODEL, "none": _no_distortion()}[model]
            single = [part.astype(np.float32) for part in boards], [part.astype(np.float32) for part in corners]
            _, k, d, turns, places = cv2.calibrateCamera(*single, size, None, None, flags=flags, criteria=_STOP)
    except cv2.error as error:
        raise CalibrationError(f"these pictures determine no camera: tilt the board more ({error.err})") from None
    k, d = np.asarray(k, dtype=np.float64), np.asarray(d, dtype=np.float64).ravel()[: MODELS[model]]
    rms, sigma = _quality(views, model, k, d, turns, places)
    values = (k[0, 0], k[1, 1], k[0, 2], k[1, 2], *d, rms)
    if not np.isfinite(values).all() or min(k[0, 0], k[1, 1]) <= 0.0:
        raise CalibrationError("these pictures determine no camera: tilt the board more, and hold it everywhere")
    fx, fy, cx, cy = (float(x) for x in values[:4])
    return Calibrated(
        width=size[0], height=size[1], fx=fx, fy=fy, cx=cx, cy=cy, lens=Lens(model, tuple(float(x) for x in d)),
        sigma=sigma, rms=rms, coverage=coverage(views, size), views=len(views),
        corners=sum(len(view.corners) for view in views),
    )  # fmt: skip


def coverage(views: Iterable[View], size: tuple[int, int]) -> float:
    """Share of the picture's cells in which a corner was seen."""
    cells = {(int(u * _CELLS[0] // size[0]), int(v * _CELLS[1] // size[1])) for view in views for u, v in view.corners}
    return len(cells) / (_CELLS[0] * _CELLS[1])


def _no_distortion() -> int:
    return cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST


def _quality(
    views: list[View], model: str, k: np.ndarray, d: np.ndarray, turns: Iterable, places: Iterable
) -> tuple[float, tuple[float, float, float, float]]:
    """Reprojection error (px, rms) and one-sigmas of fx, fy, cx, cy (px), from the residuals and their Jacobian."""
    own = 4 + MODELS[model]
    information, squares, count = np.zeros((own, own)), 0.0, 0
    for view, turn, place in zip(views, turns, places, strict=True):
        seen, intrinsic, extrinsic = _projected(view.board, np.asarray(turn), np.asarray(place), model, k, d)
        residual = (view.corners - seen).ravel()
        coupling = intrinsic.T @ extrinsic
        # the pose of each picture is estimated too: what it explains tells nothing of the camera
        information += intrinsic.T @ intrinsic - coupling @ np.linalg.pinv(extrinsic.T @ extrinsic) @ coupling.T
        squares += float(residual @ residual)
        count += len(residual)
    variance = squares / max(1, count - own - 6 * len(views))
    deviation = np.sqrt(np.maximum(0.0, variance * np.diag(np.linalg.pinv(information, hermitian=True))))
    fx, fy, cx, cy = (float(x) for x in deviation[:4])
    return float(np.sqrt(squares / (count / 2))), (fx, fy, cx, cy)


def _projected(
    board: np.ndarray, turn: np.ndarray, place: np.ndarray, model: str, k: np.ndarray, d: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (n, 2) px of one view, and the Jacobians by fx, fy, cx, cy and distortion, and by the view's pose."""
    if model == "fisheye":
        seen, jacobian = cv2.fisheye.projectPoints(board[None], turn, place, k, d)
        return seen.reshape(-1, 2), jacobian[:, :8], jacobian[:, 8:14]
    seen, jacobian = cv2.projectPoints(board, turn, place, k, d if len(d) else None)
    return seen.reshape(-1, 2), jacobian[:, 6 : 10 + len(d)], jacobian[:, :6]
