import re
import struct

import cv2
import numpy as np
import pytest

from groundcar.board.face import bitmap, rectangles, tag_bitmap
from groundcar.board.layout import Board, BoardTag, rotation_from_car
from groundcar.board.printing import write_printable
from kernel.rotations import from_euler
from vehicle.apriltag.library import TagDetector
from vehicle.camera.pinhole import Camera, board_row_visibility

BOARD = Board()


def found(picture, **options):
    return {tag.id: tag for tag in TagDetector().detect(picture, **options)}


def test_bitmap_decodes_and_corners_agree_with_the_layout():
    scale, border = 6, 40
    face = np.kron(bitmap(BOARD), np.ones((scale, scale), np.uint8))
    tags = found(np.pad(face, border, constant_values=255))
    assert sorted(tags) == list(range(11))
    for tag_id, tag in tags.items():
        xy = BOARD.corners_by_id[tag_id][:, :2]
        # rows run down-slope (-x), columns to the right (-y); the first pixel's centre is half a pixel inside
        metre = scale / BOARD.module
        expected = np.column_stack((BOARD.size / 2 - xy[:, 1], BOARD.size / 2 - xy[:, 0])) * metre + border - 0.5
        assert np.abs(tag.corners - expected).max() < 0.1


def test_small_tags_cover_no_sample_point_of_the_large_one():
    large = BOARD.tags[0]
    module = large.width / 8
    samples = (np.arange(10) - 4.5) * module  # cell centres, those of its white ring among them
    for tag in BOARD.tags[1:]:
        ring = tag.width / 2 * 10 / 8
        covered = [np.abs(samples + at - centre) < ring - 1e-9 for at, centre in ((large.x, tag.x), (large.y, tag.y))]
        assert not (covered[0].any() and covered[1].any())


def test_a_level_camera_at_contact_has_the_row_of_small_tags_in_its_picture():
    """A drone that sits level with the board on its centre, however the board is inclined."""
    camera = Camera()
    row, below = camera.row(), 0.05
    for inclination in np.radians([0.0, 30.0, 60.0, 80.0]):
        board = np.array([0.0, 0.0, 1.5, 0.0, 0.0, 0.0, inclination, 0.0])
        normal = rotation_from_car(0.0, inclination)[:, 2]
        attitude = np.array(from_euler(0.0, -inclination, 0.0))
        assert board_row_visibility(board[:3] + below * normal, attitude, board, row) == 1
    without = camera.row(Board(tags=BOARD.tags[:6]))
    assert board_row_visibility(board[:3] + below * normal, attitude, board, without) == 0


def test_black_rectangles_are_the_bitmap():
    grid = np.full_like(bitmap(BOARD), 255)
    covered = np.zeros(grid.shape, int)
    for row, column, rows, columns in rectangles(bitmap(BOARD)):
        grid[row : row + rows, column : column + columns] = 0
        covered[row : row + rows, column : column + columns] += 1
    assert np.array_equal(grid, bitmap(BOARD))
    assert covered.max() == 1


def test_normal_faces_backward_and_up():
    R = rotation_from_car(0.0, np.radians(70.0))
    assert np.allclose(R[:, 2], [-np.sin(np.radians(70)), 0.0, np.cos(np.radians(70))])
    assert np.allclose(R @ R.T, np.eye(3))
    assert np.linalg.det(R) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "tags",
    [
        (),
        (BoardTag(0, 0.336, 0.0, 0.0), BoardTag(0, 0.0336, 0.084, 0.084)),
        (BoardTag(0, 0.4, 0.0, 0.0),),
        (BoardTag(0, 0.336, 0.0, 0.0), BoardTag(1, 0.0336, 0.0841, 0.084)),
    ],
)
def test_boards_that_cannot_be_printed_are_refused(tags):
    with pytest.raises(ValueError, match=r"tag|grid"):
        Board(tags=tags)


def test_unknown_tag_id_is_refused():
    with pytest.raises(ValueError, match="587"):
        tag_bitmap(587)


def test_png_is_true_to_size_and_decodes(tmp_path):
    path = write_printable(tmp_path / "board.png", dpi=150)
    face = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
    data = path.read_bytes()
    per_metre = struct.unpack(">I", data[data.index(b"pHYs") + 4 :][:4])[0]
    assert len(face) / per_metre == pytest.approx(0.42, rel=1e-3)
    assert sorted(found(np.pad(face, 20, constant_values=255))) == list(range(11))


def test_svg_and_pdf_draw_the_same_black_area_at_true_size(tmp_path):
    black = float(np.mean(bitmap(BOARD) == 0)) * BOARD.size**2
    svg = write_printable(tmp_path / "board.svg").read_text()
    boxes = re.findall(r"h([\d.]+)v([\d.]+)h-", svg)
    assert sum(float(w) * float(h) for w, h in boxes) * 1e-6 == pytest.approx(black, rel=1e-4)
    pdf = write_printable(tmp_path / "board.pdf").read_bytes()
    boxes = re.findall(rb"([\d.]+) ([\d.]+) re\n", pdf)
    point = 0.0254 / 72
    assert sum(float(w) * float(h) for w, h in boxes) * point**2 == pytest.approx(black, rel=1e-4)
    # every offset of the cross-reference table points at its object
    table = re.findall(rb"(\d{10}) 00000 n", pdf)
    assert all(pdf[int(o) :].startswith(b"%d 0 obj" % i) for i, o in enumerate(table, 1))
    assert pdf[int(pdf.split(b"startxref\n")[1].split(b"\n")[0]) :].startswith(b"xref")


def test_other_file_types_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"\.pdf"):
        write_printable(tmp_path / "board.docx")
