import math

import cv2
import numpy as np
import pytest

from tests.unit.vehicle.render.camera_scene import BOARD, CAMERA, ROW, board_in_camera, pixels, view
from vehicle.apriltag.library import TagDetector
from vehicle.camera.pinhole import Camera
from vehicle.render.board import MAX_SAMPLES, sample_offsets
from vehicle.render.ground import doubled
from vehicle.render.pose import board_in_camera_at, camera_at, face_from_pixel, motion_row
from vehicle.render.renderer import Renderer
from vehicle.render.sensor import Sensor

QUIET = Sensor(read_noise=0.1, electrons_per_dn=1e5, vignetting=0.0)
RENDERER = Renderer(CAMERA, BOARD, 1, QUIET)
STILL = 0


@pytest.mark.parametrize("shape", [(2, 2), (3, 5), (36, 64)])
def test_background_is_enlarged_as_opencv_does_it(shape):
    rng = np.random.default_rng(sum(shape))
    for image in (rng.integers(0, 256, shape), 255 * rng.integers(0, 2, shape), np.full(shape, 255)):
        small, out = image.astype(np.uint8), np.empty((2 * shape[0], 2 * shape[1]), np.uint8)
        doubled(small, out)
        theirs = cv2.resize(small, out.shape[::-1], interpolation=cv2.INTER_LINEAR)
        assert np.abs(out.astype(int) - theirs).max() <= 1  # its own rounding differs between processors


def test_pose_kernels_agree_with_the_camera():
    vehicle, board = view(2.0, 40.0, rate=(0.3, -0.4, 0.5), velocity=(1.0, 2.0, 3.0))
    R, p = np.empty((3, 3)), np.empty(3)
    board_in_camera_at(vehicle, board, 0.0, ROW, R, p)
    truth_R, truth_p, _ = board_in_camera(vehicle, board)
    assert np.allclose(R, truth_R)
    assert np.allclose(p, truth_p)
    later_R, later_p = np.empty((3, 3)), np.empty(3)
    camera_at(vehicle, 0.01, ROW, later_R, later_p)
    camera_at(vehicle, 0.0, ROW, R, p)
    lever = np.cross([0.3, -0.4, 0.5], CAMERA.offset)
    body_R = R @ _optical_from_body()
    assert np.allclose((later_p - p) / 0.01, vehicle[3:6] + body_R @ lever, atol=2e-3)


def _optical_from_body():
    c, s = math.cos(CAMERA.tilt), math.sin(CAMERA.tilt)
    return np.array([[0.0, -1.0, 0.0], [-s, 0.0, -c], [c, 0.0, -s]])


def test_face_homography_inverts_the_projection():
    R, p, _ = board_in_camera(*view(1.5, 55.0, roll=0.2, aside=0.1))
    h = np.empty((3, 3))
    assert face_from_pixel(R, p, ROW, h) < 0.0  # front
    point = np.array([[0.11, -0.07, 0.0]])
    u, v = pixels(point, R, p)[0]
    x, y, s = h @ (u, v, 1.0)
    assert np.allclose((x / s, y / s), point[0, :2])
    assert 1.0 / s == pytest.approx((R @ point[0] + p)[2])
    assert face_from_pixel(R @ np.diag([1.0, -1.0, -1.0]), p, ROW, h) > 0.0  # back


@pytest.mark.parametrize("count", [4, 9, MAX_SAMPLES])
def test_samples_are_centred_and_inside(count):
    out = np.zeros((MAX_SAMPLES, 3))
    sample_offsets(count, out)
    assert np.allclose(out[:count].mean(axis=0), 0.0, atol=1e-12)
    assert np.abs(out[:count]).max() < 0.75


@pytest.mark.parametrize(("distance", "incidence"), [(0.45, 5.0), (0.8, 0.0), (0.8, 50.0), (2.0, 30.0), (2.0, 65.0)])
def test_rendered_corners_agree_with_the_projection(distance, incidence):
    vehicle, board = view(distance, incidence, roll=0.1, aside=0.05)
    R, p, _ = board_in_camera(vehicle, board)
    tags = TagDetector().detect(RENDERER.render(vehicle, board, STILL, 0), 1.0)
    large = next(tag for tag in tags if tag.id == 0)
    assert np.abs(large.corners - pixels(BOARD.corners_by_id[0], R, p)).max() < 0.1


def test_small_tags_agree_with_the_projection():
    vehicle, board = view(0.3, 20.0, roll=0.1, aside=0.05)
    R, p, _ = board_in_camera(vehicle, board)
    tags = [t for t in TagDetector().detect(RENDERER.render(vehicle, board, STILL, 0), 1.0) if t.id > 0]
    assert len(tags) >= 3
    errors = np.concatenate([tag.corners - pixels(BOARD.corners_by_id[tag.id], R, p) for tag in tags])
    # Single corners reach 0.16 px where the detector's line fit catches an edge of the large tag beside them
    assert np.sqrt(np.mean(errors**2)) < 0.1
    assert np.abs(np.median(errors, axis=0)).max() < 0.03


def _mean_gradient(image):
    part = image.astype(float)
    return np.abs(np.diff(part, axis=1)).mean(), np.abs(np.diff(part, axis=0)).mean()


def test_blur_runs_along_the_motion():
    box = (slice(300, 420), slice(560, 720))
    sharp = _mean_gradient(RENDERER.render(*view(1.0, 0.0), 3_000_000, 0)[box])
    yawing = _mean_gradient(RENDERER.render(*view(1.0, 0.0, rate=(0.0, 0.0, 3.5)), 3_000_000, 0)[box])
    pitching = _mean_gradient(RENDERER.render(*view(1.0, 0.0, rate=(0.0, 3.5, 0.0)), 3_000_000, 0)[box])
    assert yawing[0] < 0.85 * sharp[0]
    assert yawing[1] > 0.93 * sharp[1]
    assert pitching[1] < 0.85 * sharp[1]
    assert pitching[0] > 0.93 * sharp[0]


def test_blur_is_as_long_as_the_motion():
    """An edge swept over L px becomes a ramp of L px: its steepest step falls to contrast / L."""
    vehicle, board = view(1.0, 0.0, rate=(0.0, 0.0, 3.0))
    picture = RENDERER.render(vehicle, board, 4_000_000, 0).astype(float)
    length = 3.0 * 4e-3 * CAMERA.fx
    R, p, _ = board_in_camera(vehicle, board)
    large = BOARD.tags[0]
    u, v = pixels(np.array([[large.x, large.width / 2, 0.0]]), R, p)[0]  # middle of its left edge
    row = picture[round(v) + 3, round(u) - 20 : round(u) + 21]
    low, high = row[-6:].mean(), row[:6].mean()
    width = np.sum((row > low + 0.1 * (high - low)) & (row < low + 0.9 * (high - low)))
    assert width == pytest.approx(0.8 * length * math.cos(math.radians(20.0)), abs=2.0)


def test_equal_arguments_give_equal_bytes_and_the_frame_changes_the_noise():
    args = view(1.5, 40.0, rate=(0.5, 1.0, 0.0))
    one = Renderer(CAMERA, BOARD, 7)
    first = one.render(*args, 2_000_000, 3)
    one.render(*view(0.3, 10.0), 2_000_000, 4)  # scratch of another picture must not shine through
    assert np.array_equal(first, one.render(*args, 2_000_000, 3))
    assert np.array_equal(first, Renderer(CAMERA, BOARD, 7).render(*args, 2_000_000, 3))
    assert not np.array_equal(first, one.render(*args, 2_000_000, 4))
    assert not np.array_equal(first, Renderer(CAMERA, BOARD, 8).render(*args, 2_000_000, 3))
    assert first.shape == (720, 1280)
    assert first.dtype == np.uint8


def test_noise_grows_with_light_as_shot_noise_does():
    sensor = Sensor(electrons_per_dn=40.0, read_noise=0.8, vignetting=0.0)
    renderer = Renderer(CAMERA, BOARD, 2, sensor)
    vehicle, board = view(0.25, 0.0)
    stack = np.stack([renderer.render(vehicle, board, STILL, k) for k in range(40)]).astype(float)
    mean, variance = stack.mean(axis=0), stack.var(axis=0, ddof=1)
    for low, high in ((10.0, 40.0), (150.0, 240.0)):
        at = (mean > low) & (mean < high)
        expected = mean[at].mean() / 40.0 + 0.64 + 1 / 12  # rounding to whole DN adds 1/12
        assert variance[at].mean() == pytest.approx(expected, rel=0.08)


def test_vignetting_darkens_the_corner_by_its_share():
    vehicle, board = view(3.0)
    vehicle[2] = 300.0  # far above: all ground, uniform but for texture
    flat = Renderer(CAMERA, BOARD, 1, QUIET).render(vehicle, board, STILL, 0).astype(float)
    lossy = Renderer(CAMERA, BOARD, 1, Sensor(read_noise=0.1, electrons_per_dn=1e5, vignetting=0.25))
    ratio = lossy.render(vehicle, board, STILL, 0)[-20:, -20:].mean() / flat[-20:, -20:].mean()
    assert ratio == pytest.approx(0.75, abs=0.02)


def test_the_back_is_dark_and_shows_no_tag():
    vehicle, board = view(1.0, 0.0)
    q = board[6:10]
    board[6:10] = -q[2], q[3], q[0], -q[1]  # turned half a turn about its y axis: the normal points away
    picture = RENDERER.render(vehicle, board, STILL, 0)
    assert TagDetector().detect(picture) == []
    u, v = pixels(np.zeros((1, 3)), *board_in_camera(vehicle, board)[:2])[0].astype(int)
    assert picture[v - 10 : v + 10, u - 60 : u - 40].mean() < 60.0


def test_board_behind_or_around_the_camera_renders_without_error():
    for distance in (-2.0, -0.05, 0.0, 0.005, 0.05):
        picture = RENDERER.render(*view(distance, 10.0), 2_000_000, 0)
        assert picture.shape == (720, 1280)


def test_invalid_render_input_is_refused():
    vehicle, board = view(1.0)
    broken = vehicle.copy()
    broken[4] = math.nan
    with pytest.raises(ValueError, match="finite"):
        RENDERER.render(broken, board, 1, 0)
    with pytest.raises(ValueError, match="exposure"):
        RENDERER.render(vehicle, board, -1, 0)
    with pytest.raises(ValueError, match="multiple"):
        Renderer(Camera(width=1281), BOARD, 0)
    with pytest.raises(ValueError, match="unit quaternion"):
        motion_row((0, 0, 0), (2, 0, 0, 0))
