"""Distortion: points there and back, pictures that are bent, the board found in them, calibrations that come back."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from groundcar.board.charuco import charuco_bitmap
from groundcar.board.layout import Board
from kernel.rotations import from_euler
from tests.unit.vehicle.render.camera_scene import BOARD, board_in_camera, view
from vehicle.apriltag.detector import BoardDetector
from vehicle.camera.calibrate import CalibrationError, View, calibrate, coverage, find_corners
from vehicle.camera.distortion import distorted, drawn_camera, edges, picture_maps, undistorted
from vehicle.camera.lens import MODELS, Lens
from vehicle.camera.pinhole import Camera
from vehicle.render import renderer
from vehicle.render.pose import motion_row
from vehicle.render.renderer import Renderer

PINHOLE = Lens("pinhole", (-0.28, 0.09, 0.0006, -0.0004, -0.012))
RATIONAL = Lens("rational", (0.3, 0.02, 0.0004, 0.0003, 0.001, 0.55, 0.03, 0.001))
FISHEYE = Lens("fisheye", (-0.02, 0.004, -0.003, 0.0006))
LENSES = [PINHOLE, RATIONAL, FISHEYE]
SMALL = Camera(width=640, height=480, fx=400.0, fy=401.0, cx=322.0, cy=238.0)


def grid(camera, step=40):
    u, v = np.meshgrid(np.arange(0.0, camera.width, step), np.arange(0.0, camera.height, step))
    return np.stack([u, v], axis=-1)


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.model)
def test_points_come_back(lens):
    camera = Camera(lens=lens)
    there = undistorted(grid(camera), camera)
    assert np.abs(there - grid(camera)).max() > 20.0
    assert distorted(there, camera) == pytest.approx(grid(camera), abs=1e-3)


def test_no_distortion_moves_nothing():
    for lens in (Lens(), Lens("none"), Lens("pinhole", (0.0,) * 5)):
        camera = Camera(lens=lens)
        points = grid(camera)
        assert undistorted(points, camera) is points and distorted(points, camera) is points
        assert drawn_camera(camera) is camera
        assert edges(camera) == (-0.5, 1279.5, -0.5, 719.5)


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.model)
def test_points_beyond_the_picture_stay_beyond_it(lens):
    camera = Camera(lens=lens)
    far = np.array([(-9000.0, 300.0), (9000.0, 300.0), (600.0, -9000.0), (600.0, 9000.0)])
    found = distorted(far, camera)
    assert found[0, 0] < 0 and found[1, 0] > 1279 and found[2, 1] < 0 and found[3, 1] > 719


@pytest.mark.parametrize(
    ("model", "coefficients", "said"),
    [
        ("wide", (), "no distortion model"),
        ("fisheye", (0.0,) * 5, "4 coefficients, not 5"),
        ("none", (0.1,), "0 coefficients"),
        ("pinhole", (0.0, 0.0, math.nan, 0.0, 0.0), "not finite"),
    ],
)
def test_wrong_coefficients_are_refused(model, coefficients, said):
    with pytest.raises(ValueError, match=said):
        Lens(model, coefficients)


def test_lens_that_sees_too_wide_cannot_be_drawn():
    with pytest.raises(ValueError, match="too wide"):
        Renderer(Camera(fx=420.0, fy=420.0, lens=Lens("fisheye", (0.0,) * 4)), Board(), 1)


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.model)
def test_board_is_found_where_it_is_through_a_lens(lens):
    camera = Camera(lens=lens)
    drawn, wrong = Renderer(camera, BOARD, 1), BoardDetector(Camera(), BOARD)
    errors, without = [], []
    for aside in (0.0, 0.2, -0.4):
        vehicle, board = view(1.2, 35.0, aside=aside)
        R, p, up = board_in_camera(vehicle, board)
        picture = drawn.render(vehicle, board, 0, 0)
        for prior in (None, (R, p)):
            seen = BoardDetector(camera, BOARD).detect(picture, prior, up)
            assert seen.found, seen.reason
            errors.append(np.linalg.norm(seen.p - p))
            # the corners are told where they are in the picture
            ideal = BOARD.corners_by_id[seen.ids[0]] @ R.T + p
            ideal = ideal[:, :2] / ideal[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
            assert seen.corners[0] == pytest.approx(distorted(ideal, camera), abs=1.2)
        blind = wrong.detect(picture, (R, p), up)
        without.append(np.linalg.norm(blind.p - p) if blind.found else math.inf)
    assert max(errors) < 0.008
    assert max(without) > 0.03  # what it costs to leave the lens out


def pictures(camera, monkeypatch, count=24):
    """Pictures of the calibration board, 0.42 m wide, from all sides and in all parts of the picture."""
    monkeypatch.setattr(renderer, "bitmap", lambda _: charuco_bitmap())
    drawn, random = Renderer(camera, Board(), 1), np.random.default_rng(5)
    rays = undistorted(grid(camera, 60)[1:-1, 1:-1].reshape(-1, 2), camera)
    for k in range(count):
        u, v = rays[random.permutation(len(rays))[0]] if k % 4 else (camera.cx, camera.cy)
        distance = random.uniform(0.55, 0.9)
        x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
        ahead = np.array([1.0, -x, -y])
        place = np.array([0.0, 0.0, 2.0]) + distance * ahead / np.linalg.norm(ahead)
        # the board's normal points back at the camera, tilted by up to 35 deg, turned about it at random
        tilt = random.uniform(-0.6, 0.6, 2)
        q = from_euler(tilt[0], -math.pi / 2 + tilt[1] + math.atan(y), math.atan(-x) + random.uniform(-0.2, 0.2))
        yield drawn.render(motion_row((0.0, 0.0, 2.0), (1.0, 0.0, 0.0, 0.0)), motion_row(place, q), 0, k)


@pytest.mark.parametrize("lens", [PINHOLE, FISHEYE, Lens()], ids=lambda lens: lens.model)
def test_true_intrinsics_come_back_within_stated_errors(lens, monkeypatch):
    camera = replace(SMALL, lens=lens, offset=(0.0, 0.0, 0.0), tilt=0.0)
    views = [found for picture in pictures(camera, monkeypatch) if (found := find_corners(picture)) is not None]
    done = calibrate(views, (camera.width, camera.height), lens.model)
    assert done.views >= 16 and done.coverage > 0.6 and done.rms < 0.25
    for name, sigma in zip(("fx", "fy", "cx", "cy"), done.sigma, strict=True):
        assert 0.0 < sigma < 1.0
        assert getattr(done, name) == pytest.approx(getattr(camera, name), abs=max(4.0 * sigma, 0.3)), name
    found = replace(camera, fx=done.fx, fy=done.fy, cx=done.cx, cy=done.cy, lens=done.lens)
    # what counts: the directions of pixels to each other, for a turn of the camera is part of its mount
    inner = grid(camera)[2:-2, 2:-2]
    ideal = (undistorted(inner, camera) - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    shift = distorted(ideal * (found.fx, found.fy) + (found.cx, found.cy), found) - inner
    assert np.abs(shift - shift.mean(axis=(0, 1))).max() < 0.6


def test_calibration_board_is_found_whole_and_upright():
    face = np.kron(charuco_bitmap(), np.ones((8, 8), np.uint8))
    found = find_corners(np.pad(face, 60, constant_values=255))
    assert found is not None and len(found.corners) == 49
    modules = found.board[:, :2] / 0.022 * 9 * 8 + 60 - 0.5
    assert np.abs(found.corners - modules).max() < 0.6


def test_calibration_without_enough_pictures_is_refused():
    flat = View(np.column_stack((np.mgrid[0:4, 0:4].reshape(2, -1).T * 0.022, np.zeros(16))), np.ones((16, 2)))
    with pytest.raises(CalibrationError, match="in 3 pictures, 8 are the least"):
        calibrate([flat] * 3, (640, 480), "pinhole")
    for model in MODELS:
        with pytest.raises(CalibrationError, match="determine no camera"):
            calibrate([flat] * 9, (640, 480), model)


def test_coverage_is_the_share_of_the_pictures_cells():
    corners = np.array([(1.0, 1.0), (2.0, 2.0), (639.0, 479.0)])
    assert coverage([View(np.zeros((3, 3)), corners)], (640, 480)) == pytest.approx(2 / 40)


def test_maps_of_the_picture_and_points_agree():
    """A point drawn in the pinhole picture is seen where `distorted` says."""
    camera = replace(SMALL, lens=PINHOLE)
    drawn = drawn_camera(camera)
    canvas = np.zeros((drawn.height, drawn.width), np.uint8)
    at = np.array([drawn.cx + 150.0, drawn.cy - 120.0]).round()
    cv2.circle(canvas, tuple(int(x) for x in at), 4, 255, -1)
    seen = cv2.remap(canvas, *picture_maps(camera, drawn), cv2.INTER_LINEAR).astype(float)
    v, u = np.indices(seen.shape)
    centre = np.array([(seen * u).sum(), (seen * v).sum()]) / seen.sum()
    assert centre == pytest.approx(distorted(at - (drawn.cx - camera.cx, drawn.cy - camera.cy), camera), abs=0.2)
