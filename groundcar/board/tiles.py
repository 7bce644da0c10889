"""The board in tiles for an ordinary printer: a PDF of A4 or A3 pages that are cut at marks and laid edge to edge."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from groundcar.board.face import bitmap, rectangles
from groundcar.board.layout import Board
from groundcar.board.printing import POINT, pdf_document

PAPERS = {"A4": (0.210, 0.297), "A3": (0.297, 0.420)}  # m, upright
_MARGIN = 0.010  # m, that a printer leaves white
_FOOT = 0.014  # m, for the caption and the 100 mm line
_BEYOND = 2  # modules that a tile prints beyond its cut, so that a cut that is not exact shows no white
_MARK = 0.005  # m, length of a cut mark


def write_tiles(path: str | Path, paper: str, board: Board | None = None) -> int:
    """Write the board to `path` (.pdf) as tiles of `paper` (a key of PAPERS); how many pages there are.

    Every tile is cut at module edges. Raises ValueError for another suffix or paper, OSError.
    """
    path, board = Path(path), board or Board()
    if path.suffix.lower() != ".pdf":
        raise ValueError(f"tiles of paper are the pages of a .pdf, not of {path.name!r}")
    if paper not in PAPERS:
        raise ValueError(f"there is no paper {paper!r}: {' or '.join(PAPERS)}")
    pages = list(_pages(bitmap(board), board.module, *PAPERS[paper]))
    path.write_bytes(pdf_document(pages))
    return len(pages)


def cuts(modules: int, room: float, module: float) -> list[int]:
    """Where a face of `modules` is cut so that each tile, with what it prints beyond, fits into `room` (m)."""
    tiles = math.ceil(modules / (math.floor(room / module) - 2 * _BEYOND))
    return [round(modules * number / tiles) for number in range(tiles + 1)]


def _pages(face: np.ndarray, module: float, width: float, height: float) -> Iterator[tuple[float, float, str]]:
    """Each tile's page, row by row from up-slope, as `pdf_document` takes it."""
    room = 2 * (_MARGIN + _MARK)
    rows = cuts(len(face), height - room - _FOOT, module)
    columns = cuts(len(face), width - room, module)
    for row, (top, bottom) in enumerate(pairwise(rows), 1):
        for column, (left, right) in enumerate(pairwise(columns), 1):
            where = f"row {row} of {len(rows) - 1} from up-slope, column {column} of {len(columns) - 1} from the left"
            drawn = _tile(face, module, (top, bottom, left, right), height, where)
            yield width / POINT, height / POINT, drawn


def _tile(face: np.ndarray, module: float, box: tuple[int, int, int, int], height: float, where: str) -> str:
    top, bottom, left, right = box
    first_row, first_column = max(0, top - _BEYOND), max(0, left - _BEYOND)
    part = face[first_row : bottom + _BEYOND, first_column : right + _BEYOND]
    origin = _MARGIN + _MARK + _BEYOND * module  # of the cut box, from the page's left and upper edge

    def x(column: float) -> float:
        return (origin + (column - left) * module) / POINT

    def y(row: float) -> float:
        return (height - origin - (row - top) * module) / POINT

    m, mark = module / POINT, _MARK / POINT
    boxes = "".join(
        f"{x(first_column + c):.4f} {y(first_row + r + h):.4f} {w * m:.4f} {h * m:.4f} re\n"
        for r, c, h, w in rectangles(part)
    )
    outer = _BEYOND * m
    marks = "".join(
        f"{x(column):.4f} {y(row) + up * outer:.4f} m {x(column):.4f} {y(row) + up * (outer + mark):.4f} l S\n"
        f"{x(column) + side * outer:.4f} {y(row):.4f} m {x(column) + side * (outer + mark):.4f} {y(row):.4f} l S\n"
        for row, up in ((top, 1), (bottom, -1))
        for column, side in ((left, -1), (right, 1))
    )
    foot, line = (_MARGIN + 0.006) / POINT, 0.1 / POINT
    caption = f"{where}; print at 100 %, cut at the marks; the line is 100 mm"
    return (
        f"0 g\n{boxes}f\n0 G 0.3 w\n{marks}"
        f"BT /F1 8 Tf {_MARGIN / POINT:.3f} {foot:.3f} Td ({caption}) Tj ET\n"
        f"0.8 w {_MARGIN / POINT:.4f} {_MARGIN / POINT:.4f} m {_MARGIN / POINT + line:.4f} {_MARGIN / POINT:.4f} l S\n"
    )
