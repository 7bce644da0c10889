"""The simulated camera draws the scene as it was at the middle of the exposure, whenever it draws it."""

import numpy as np

from groundcar.board.layout import Board
from hil.contract.messages import BoardState, Stage, VehicleState
from hil.nodes.camera_sim import CameraSim
from kernel.rotations import from_euler
from tests.unit.hil.contract.node_fakes import filled
from vehicle.camera.pinhole import Camera
from vehicle.render.renderer import Renderer

MS = 1_000_000
EXPOSURE, TRANSPORT = 2 * MS, 15 * MS
SPEED = 2.0


def camera(**settings):
    return CameraSim(Renderer(Camera(), Board(), 1), 60.0, EXPOSURE, TRANSPORT, **settings)


def look(now_ns, truth_ns, stage="attempt", **settings):
    """One picture taken at `now_ns` of a board that passes at SPEED, from truth that was known at `truth_ns`."""
    node = camera(**settings)
    x = SPEED * truth_ns * 1e-9
    vehicle = VehicleState(truth_ns, (-2.5, 0.0, 2.0), (0.0,) * 3, from_euler(0.0, 0.0, 0.0), (0.0,) * 3)
    velocity, q = (0.0, SPEED, 0.0), from_euler(0.0, -1.2, 0.0)
    board = BoardState(truth_ns, (0.0, x, 1.5), velocity, q, 0.0, SPEED, 0.0)
    messages = [("truth/vehicle", vehicle), ("truth/board", board), ("run/stage", Stage(0, stage, 0, 0))]
    return node.step(now_ns, filled(node, *messages))


def test_camera_sim_publishes_nothing_before_the_car_drives():
    assert look(0, 0, "prepare") == []


def test_picture_rendered_later_has_equal_content_and_delivery_time():
    (at_once,) = look(100 * MS, 98 * MS)
    (later,) = look(104 * MS, 102 * MS, drawn_after_ns=4 * MS)
    assert at_once.message.stamp_ns == later.message.stamp_ns == 100 * MS
    assert 100 * MS + at_once.delay_ns == 104 * MS + later.delay_ns == 116 * MS
    one, other = (np.frombuffer(out.message.data, np.uint8).astype(int) for out in (at_once, later))
    assert np.abs(one - other).max() <= 1
    (moved,) = look(100 * MS, 90 * MS, drawn_after_ns=4 * MS)
    assert moved.message.stamp_ns == 96 * MS
    assert np.abs(np.frombuffer(moved.message.data, np.uint8).astype(int) - one).max() > 20


def test_camera_sim_publishes_nothing_within_its_lookahead():
    for settings in ({}, {"drawn_after_ns": 4 * MS}, {"drawn_after_ns": 50 * MS}):
        (out,) = look(100 * MS, 98 * MS, **settings)
        assert out.delay_ns == camera(**settings).lookahead_ns


def test_picture_is_not_delivered_before_rendering_ends():
    (out,) = look(100 * MS, 98 * MS, drawn_after_ns=50 * MS)
    assert (out.message.stamp_ns, out.delay_ns) == (84 * MS, 0)
