"""The face of the board: its tags drawn on a grid of modules, as a bitmap and as black rectangles."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from groundcar.board.layout import TAG_MODULES, Board


@cache
def tag_bitmap(tag_id: int) -> np.ndarray:
    """One 36h11 tag with its white ring, upright: (10, 10) uint8, 0 or 255. Raises ValueError if there is no such id.

    OpenCV draws the family rotated by 180 deg against the AprilTag library.
    """
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    count = len(family.bytesList)
    if not 0 <= tag_id < count:
        raise ValueError(f"tag36h11 has ids 0..{count - 1}, not {tag_id}")
    upright = np.rot90(family.generateImageMarker(tag_id, TAG_MODULES), 2)
    bitmap = np.pad(upright, 1, constant_values=255)
    bitmap.setflags(write=False)
    return bitmap


@cache
def bitmap(board: Board) -> np.ndarray:
    """The face as (modules, modules) uint8, 0 black or 255 white; rows run down-slope, columns left to right."""
    grid = np.full((board.modules, board.modules), 255, np.uint8)
    for tag in board.tags:
        scale = round(tag.width / board.module / TAG_MODULES)
        picture = np.kron(tag_bitmap(tag.id), np.ones((scale, scale), np.uint8))
        row, column = (round(edge) for edge in board.grid_box(tag))
        grid[row : row + len(picture), column : column + len(picture)] = picture
    grid.setflags(write=False)
    return grid


def rectangles(face: np.ndarray) -> list[tuple[int, int, int, int]]:
    """Black area of a bitmap as (row, column, rows, columns) in modules, none overlapping: for vector output."""
    open_runs: dict[tuple[int, int], int] = {}
    done: list[tuple[int, int, int, int]] = []
    for row in range(len(face) + 1):
        runs = _black_runs(face[row]) if row < len(face) else set()
        for run in [r for r in open_runs if r not in runs]:
            start = open_runs.pop(run)
            done.append((start, run[0], row - start, run[1]))
        for run in runs:
            open_runs.setdefault(run, row)
    return sorted(done)


def _black_runs(row: np.ndarray) -> set[tuple[int, int]]:
    """(first column, length) of each run of black in a row."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], (row == 0).astype(np.int8), [0]))))
    return {(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)}
