from dataclasses import replace

import pytest

from hil.contract.messages import VehicleState
from hil.contract.node import Inbox
from hil.nodes.external_pose import ExternalPoses

MS = 1_000_000
STILL = (0.0, 0.0, 0.0)


class Given:
    """Poses at 100 Hz of a vehicle that flies at 3 m/s along x."""

    def __init__(self, speed=8.0):
        self.poses, self.now, self.texts = ExternalPoses(speed), 0, []

    def pose(self, armed=True, **moved):
        self.now += 10 * MS
        x = 3.0 * self.now * 1e-9 + moved.get("x", 0.0)
        seen = VehicleState(self.now - 5 * MS, (x, 0.0, 1.0), STILL, (1.0, 0.0, 0.0, 0.0), STILL)
        inbox = Inbox(("mocap/vehicle",))
        inbox.put("mocap/vehicle", replace(seen, **{k: v for k, v in moved.items() if k != "x"}))
        pose, text = self.poses.take(self.now, inbox, armed)
        self.texts += [text] if text else []
        return pose


def test_no_pose_is_passed_on_before_the_first():
    assert ExternalPoses(8.0).take(0, Inbox(("mocap/vehicle",)), True) == (None, "")


def test_pose_that_has_jumped_in_flight_is_kept_back_until_it_has_jumped_back():
    given = Given()
    passed = [given.pose(x=1.0 if 20 <= k < 70 else 0.0) is not None for k in range(100)]
    assert passed == [not 20 <= k < 70 for k in range(100)]
    assert given.texts == ["a pose of motion capture is not passed on to the autopilot: it has jumped"]
    assert given.poses.refused == 50


def test_jump_of_a_vehicle_that_is_not_armed_is_no_fault():
    given = Given()
    assert all(given.pose(armed=False, x=5.0 * (k % 2)) for k in range(10))
    assert given.texts == []
    assert given.pose(armed=True, x=5.0) is not None, "carried to another place"
    assert given.pose(armed=True) is None


def test_pose_that_repeats_in_flight_is_kept_back_until_it_changes():
    given = Given()
    frozen = {"position": (0.3, 0.0, 1.0)}
    passed = [given.pose(**(frozen if 10 <= k < 50 else {})) is not None for k in range(60)]
    assert passed == [not 30 <= k < 50 for k in range(60)], "0.2 s after it has come for the first time"
    assert given.texts == [
        "a pose of motion capture is not passed on to the autopilot: it does not change, to the last bit"
    ]
    given = Given()
    assert all(given.pose(armed=False, **frozen) for _ in range(60))


def test_each_reason_is_told_once():
    given = Given()
    given.pose()
    for _ in range(3):
        given.pose(x=2.0)
        given.pose(stamp_ns=2**62)
        given.pose(position=(float("nan"), 0.0, 0.0))
    assert [text.rpartition(": ")[2] for text in given.texts] == [
        "it has jumped",
        "stamped later than now",
        "not finite",
    ]
    assert given.poses.refused == 9


@pytest.mark.parametrize("speed", [1.0, 8.0])
def test_vehicle_may_be_as_fast_as_the_gate_allows(speed):
    given = Given(speed)
    assert all(given.pose(x=(speed - 3.0) * 0.01 * k) for k in range(100))
