"""The board as pages of ordinary paper: laid edge to edge they are the board."""

import re
from itertools import pairwise

import numpy as np
import pytest

from groundcar.board.face import bitmap
from groundcar.board.layout import Board
from groundcar.board.printing import POINT
from groundcar.board.tiles import PAPERS, cuts, write_tiles

BOARD = Board()
FACE = bitmap(BOARD)
SAFE = 0.008  # m, that a printer cannot print on


def drawn(page):
    """A page's black boxes in whole modules from its upper left cut, and how far from the page's edges they lie (m)."""
    left, above = map(float, re.search(rb"0.3 w\n([\d.]+) ([\d.]+) m", page).groups())
    boxes = [tuple(map(float, box.split()[:4])) for box in re.findall(rb"[\d. ]+ re", page)]
    module = BOARD.module / POINT
    top = above - 2 * module  # the mark begins two modules beyond the cut
    grid = [((top - y - h) / module, (x - left) / module, h / module, w / module) for x, y, w, h in boxes]
    assert all(abs(value - round(value)) < 1e-3 for box in grid for value in box)
    return [tuple(map(round, box)) for box in grid], boxes


@pytest.mark.parametrize(("paper", "columns", "rows"), [("A4", 3, 2), ("A3", 2, 2)])
def test_tiles_cut_at_their_marks_are_the_board(paper, columns, rows, tmp_path):
    assert write_tiles(tmp_path / "board.pdf", paper) == columns * rows
    data = (tmp_path / "board.pdf").read_bytes()
    width, height = (side / POINT for side in PAPERS[paper])
    sizes = re.findall(rb"MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", data)
    assert len(sizes) == columns * rows
    assert all(tuple(map(float, size)) == pytest.approx((width, height), abs=1e-3) for size in sizes)
    pages = iter(re.findall(rb"stream\n(.*?)\nendstream", data, re.S))
    across = [round(BOARD.modules * k / columns) for k in range(columns + 1)]
    down = [round(BOARD.modules * k / rows) for k in range(rows + 1)]
    for top, bottom in pairwise(down):
        for left, right in pairwise(across):
            found, boxes = drawn(next(pages))
            face = np.full((bottom - top + 20, right - left + 20), 255, np.uint8)
            for r, c, h, w in found:
                face[r + 10 : r + 10 + h, c + 10 : c + 10 + w] = 0
            assert np.array_equal(face[10:-10, 10:-10], FACE[top:bottom, left:right])
            assert min(min(x, y, width - x - w, height - y - h) for x, y, w, h in boxes) * POINT > SAFE


def test_cross_references_of_several_pages_point_at_their_objects(tmp_path):
    write_tiles(tmp_path / "board.pdf", "A4")
    data = (tmp_path / "board.pdf").read_bytes()
    table = re.findall(rb"(\d{10}) 00000 n", data)
    assert len(table) == 3 + 2 * 6
    assert all(data[int(o) :].startswith(b"%d 0 obj" % i) for i, o in enumerate(table, 1))
    kids = re.search(rb"Kids \[(.*?)\]", data)[1].split(b" 0 R")[:-1]
    assert all(data[int(table[int(kid) - 1]) :].split(b"\n")[1].startswith(b"<< /Type /Page ") for kid in kids)


def test_a_tile_with_what_it_prints_beyond_its_cut_fits_its_room():
    for modules, room, module in ((110, 0.175, 0.0038), (110, 0.5, 0.0038), (97, 0.08, 0.005)):
        found = cuts(modules, room, module)
        assert found[0] == 0 and found[-1] == modules
        assert max(b - a for a, b in pairwise(found)) + 4 <= room / module


@pytest.mark.parametrize(("name", "paper", "words"), [("b.svg", "A4", r"\.pdf"), ("b.pdf", "A5", "A4 or A3")])
def test_other_files_and_papers_are_refused(name, paper, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        write_tiles(tmp_path / name, paper)
    assert not list(tmp_path.iterdir())
