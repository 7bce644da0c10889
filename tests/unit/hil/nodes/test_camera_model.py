import math

import numpy as np
import pytest

from hil.contract.messages import BoardState, Stage, VehicleState
from hil.nodes.camera_model import CameraModel
from kernel.random import stream
from kernel.rotations import from_euler
from tests.unit.hil.contract.node_fakes import filled
from vehicle.camera import bias_row, noise_row
from vehicle.camera.noise import paper_noise
from vehicle.camera.pinhole import Camera

MS = 1_000_000
TRANSPORT, PROCESSING = 16 * MS, 8 * MS
TILT = math.radians(70.0)


def camera(noise=None, seed=1):
    bias = np.zeros(bias_row.DIM)
    bias[3] = 1.0
    row = paper_noise() if noise is None else noise
    return CameraModel(Camera().row(), row, bias, stream(seed), 30.0, TRANSPORT, PROCESSING)


def vehicle(distance=2.5, heading=0.0, stamp=0, speed=0.0):
    velocity = (speed, 0.0, 0.0)
    return VehicleState(stamp, (-distance, 0.0, 2.0), velocity, from_euler(0.0, 0.0, heading), (0.0,) * 3)


def board(stamp=0, speed=0.0):
    return BoardState(stamp, (0.0, 0.0, 1.5), (speed, 0.0, 0.0), from_euler(0.0, -TILT, 0.0), 0.0, speed, 0.0)


def look(node, now_ns, seen_from, at, stage="attempt"):
    messages = [("truth/vehicle", seen_from), ("truth/board", at), ("run/stage", Stage(0, stage, 0, 0))]
    return node.step(now_ns, filled(node, *messages))


def test_camera_model_publishes_nothing_before_the_car_drives():
    node = camera()
    assert look(node, 0, vehicle(), board(), "prepare") == []
    assert node.step(0, filled(node)) == []
    assert [len(look(node, 0, vehicle(), board(), stage)) for stage in ("lead", "attempt", "ended")] == [1, 1, 1]


def test_board_in_view_is_published_after_the_transport_and_detection_delays():
    node = camera()
    assert node.period_ns == pytest.approx(1e9 / 30, abs=1)
    (out,) = look(node, 50 * MS, vehicle(stamp=50 * MS), board(stamp=50 * MS))
    seen = out.message
    assert (out.topic, out.delay_ns) == ("board/detection", TRANSPORT + PROCESSING)
    assert (seen.stamp_ns, seen.found, seen.reason, seen.processing_ns) == (50 * MS, True, "", PROCESSING)
    assert math.dist(seen.position, (0.0, 0.0, 1.5)) < 0.3
    assert 0.0 < seen.position_sigma < 0.3
    assert math.hypot(*seen.orientation) == pytest.approx(1.0)


def test_camera_model_without_noise_measures_the_truth_at_exposure_time():
    """Truth is a few milliseconds old when the shutter opens: both bodies are moved on to the exposure."""
    node = camera(noise=np.zeros(noise_row.DIM))
    (out,) = look(node, 4 * MS, vehicle(speed=2.0), board(speed=1.0))
    assert out.message.position == pytest.approx((0.004, 0.0, 1.5), abs=1e-9)


def test_board_behind_the_vehicle_gives_a_detection_without_a_board():
    node = camera()
    seen = [look(node, t, vehicle(heading=math.pi), board())[0].message for t in range(3)]
    assert [(s.found, s.reason, s.image_sequence) for s in seen] == [(False, "not visible", i) for i in range(3)]


def test_camera_model_is_equal_for_equal_seeds():
    runs = [[look(node, t, vehicle(), board())[0].message for t in range(20)] for node in (camera(), camera())]
    other = [look(node, t, vehicle(), board())[0].message for node in [camera(seed=2)] for t in range(20)]
    assert runs[0] == runs[1]
    assert runs[0] != other
