import math

import pytest

from hil.contract.messages import BoardState, VehicleState
from hil.nodes.mocap import MocapNode
from kernel.rotations import from_euler
from tests.unit.hil.contract.node_fakes import filled
from vehicle.mocap.system import Mocap, MocapNoise

MS = 1_000_000
SILENT = MocapNoise(0.0, 0.0, 0.0, 0.0)
VEHICLE = VehicleState(3 * MS, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0), (0.4, 0.5, 0.6))


def board(heading, speed=1.2, inclination=1.1):
    velocity = (speed * math.cos(heading), speed * math.sin(heading), 0.0)
    orientation = from_euler(0.0, -inclination, heading)
    return BoardState(4 * MS, (0.0, 0.0, 1.5), velocity, orientation, heading, speed, 0.7)


def measure(node, *messages):
    return {out.topic: out for out in node.step(10 * MS, filled(node, *messages))}


def test_mocap_measures_present_bodies_with_the_stamp_of_the_truth():
    node = MocapNode(Mocap(0, SILENT), Mocap(1, SILENT), 100.0, 5 * MS)
    assert node.period_ns == 10 * MS
    assert measure(node) == {}
    outs = measure(node, ("truth/vehicle", VEHICLE), ("truth/board", board(0.3)))
    assert {out.delay_ns for out in outs.values()} == {5 * MS}
    assert outs["mocap/vehicle"].message == VEHICLE
    assert outs["mocap/board"].message.stamp_ns == 4 * MS


@pytest.mark.parametrize("heading", [0.0, 0.3, 1.7, -1.7, 3.0, -3.0])
@pytest.mark.parametrize("inclination", [0.0, 0.8, 1.22, 1.5])
@pytest.mark.parametrize("speed", [1.2, -0.5])
def test_mocap_heading_and_speed_follow_from_the_pose_of_the_board(heading, inclination, speed):
    """Heading and signed speed come from the measured pose: near-vertical boards included."""
    node = MocapNode(Mocap(0, SILENT), Mocap(1, SILENT), 100.0, 0)
    seen = measure(node, ("truth/board", board(heading, speed, inclination)))["mocap/board"].message
    assert (seen.heading, seen.speed, seen.turn_rate) == pytest.approx((heading, speed, 0.7), abs=1e-9)


def test_mocap_noise_differs_between_bodies():
    """Two bodies of one system do not share their noise."""
    outs = [
        measure(MocapNode(Mocap(0), Mocap(seed), 100.0, 0), ("truth/vehicle", VEHICLE), ("truth/board", board(0.3)))
        for seed in (1, 2)
    ]
    assert outs[0]["mocap/vehicle"] == outs[1]["mocap/vehicle"]
    assert outs[0]["mocap/board"] != outs[1]["mocap/board"]
