"""`perch-hil camera calibrate` and `board --charuco`: the table it writes is a rig's, and bad pictures are refused."""

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from groundcar.board.charuco import charuco_bitmap
from hil.assembly.rig import Rig, load_rig
from hil.cli.main import app
from vehicle.camera.lens import Lens


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def picture(k):
    """The board tilted about two axes, seen by a pinhole camera of 500 px; (480, 640) uint8."""
    face = np.kron(charuco_bitmap(), np.ones((6, 6), np.uint8))
    random = np.random.default_rng(k)
    turn = cv2.Rodrigues(np.array([*random.uniform(-0.6, 0.6, 2), random.uniform(-0.3, 0.3)]))[0]
    place = np.array([*random.uniform((-0.09, -0.06), (0.09, 0.06)), random.uniform(0.24, 0.34)])
    side = 0.176
    corners = (np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * side / 2) @ turn.T + place
    seen = (corners[:, :2] / corners[:, 2:] * 500 + (319.5, 239.5)).astype(np.float32)
    edge = len(face) - 0.5
    flat = np.array([(-0.5, -0.5), (edge, -0.5), (edge, edge), (-0.5, edge)], np.float32)
    big = 4  # drawn four times as large and averaged, so that edges lie where they are
    lift = np.array([[big, 0, (big - 1) / 2], [0, big, (big - 1) / 2], [0, 0, 1]])
    drawn = cv2.warpPerspective(
        face, lift @ cv2.getPerspectiveTransform(flat, seen), (640 * big, 480 * big), borderValue=200
    )
    return cv2.resize(drawn, (640, 480), interpolation=cv2.INTER_AREA)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    for k in range(16):
        cv2.imwrite(str(folder / f"{k:02d}.png"), picture(k))
    return folder


def test_table_of_a_calibration_is_a_rigs(folder, tmp_path):
    out = tmp_path / "camera.toml"
    done = run("camera", "calibrate", folder, "--out", out)
    assert done.exit_code in (0, 1), done.output
    text = out.read_text()
    assert "reprojection error" in text and "coverage" in text and "one-sigma" in text
    rig = tmp_path / "rig.toml"
    rig.write_text(f'title = "mine"\n[camera]\nkind = "v4l2"\ndevice = "/dev/video0"\n{text}')
    found = load_rig(str(rig)).camera.calibration
    assert (found.width, found.height, found.model) == (640, 480, "pinhole")
    assert (found.fx, found.fy, found.cx, found.cy) == pytest.approx((500, 500, 319.5, 239.5), abs=1.5)
    assert len(found.distortion) == 5


def test_doubtful_calibration_says_so_and_exits_with_1(folder, tmp_path):
    few = [folder / f"{k:02d}.png" for k in range(8)]
    (tmp_path / "wall.png").write_bytes(cv2.imencode(".png", np.full((480, 640), 90, np.uint8))[1].tobytes())
    done = run("camera", "calibrate", *few, tmp_path / "wall.png", "--model", "none")
    assert "[camera.calibration]" in done.stdout and 'model = "none"' in done.stdout
    assert "board not found in wall.png" in done.stderr
    assert done.exit_code == (1 if "coverage" in done.stderr or "above" in done.stderr else 0)


@pytest.mark.parametrize("model", ["pinhole", "fisheye"])
def test_too_few_pictures_are_refused_in_one_line(folder, model):
    done = run("camera", "calibrate", folder / "00.png", folder / "01.png", "--model", model)
    assert done.exit_code == 2 and "8 are the least" in done.stderr and done.stderr.count("\n") == 1


def test_what_is_no_picture_is_refused_by_name(folder, tmp_path):
    (tmp_path / "note.png").write_text("no picture")
    for path, said in ((tmp_path / "note.png", "is no picture"), (tmp_path / "none.png", "cannot be read")):
        done = run("camera", "calibrate", path)
        assert done.exit_code == 2 and said in done.stderr and done.stderr.count("\n") == 1
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((120, 160), np.uint8))
    done = run("camera", "calibrate", folder / "00.png", tmp_path / "small.png")
    assert done.exit_code == 2 and "one camera, one size" in done.stderr
    (tmp_path / "empty").mkdir()
    done = run("camera", "calibrate", tmp_path / "empty")
    assert done.exit_code == 2 and "no picture in" in done.stderr


@pytest.mark.parametrize("suffix", ["pdf", "svg", "png"])
def test_calibration_board_is_printed(tmp_path, suffix):
    path = tmp_path / f"charuco.{suffix}"
    done = run("board", path, "--charuco")
    assert done.exit_code == 0 and "22 mm" in done.stdout and path.stat().st_size > 1000
    if suffix == "png":
        seen = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        step = seen.shape[0] // 72
        assert seen.shape[0] % 72 == 0 and np.array_equal(seen[::step, ::step], charuco_bitmap())
    assert run("board", tmp_path / "charuco.docx", "--charuco").exit_code == 2


def test_lens_of_a_rig_by_name():
    def lens(**calibration):
        return Rig.model_validate({"title": "mine", "camera": {"calibration": calibration}}).camera.calibration.lens

    assert lens() == Lens("pinhole", (0.0,) * 5) and not lens().bends
    assert lens(model="fisheye", distortion=[0.1, 0.0, 0.0, 0.0]) == Lens("fisheye", (0.1, 0.0, 0.0, 0.0))
    assert lens(distortion=[0.1, 0.0, 0.0, 0.0, 0.0]) == Lens("pinhole", (0.1, 0.0, 0.0, 0.0, 0.0))
    assert lens(model="none") == Lens()
    with pytest.raises(ValueError, match="8 coefficients, not 5"):
        lens(model="rational", distortion=[0.0] * 5)
