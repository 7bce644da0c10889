"""Items of motion capture: swapped or mirrored axes, millimetres and another body are each seen before arming."""

import math
from dataclasses import replace

import pytest

from hil.bench import mocap as bench_mocap
from hil.bench.mocap import Pose, measure_mocap
from hil.bench.reading import NotApplicable, Unavailable
from hil.check.judge import Outcome
from hil.wires.mocap_vrpn import BodyPose
from kernel.rotations import from_euler, multiply
from tests.unit.hil.check.preflight import result, with_slot

HALF = math.sqrt(0.5)


@pytest.fixture
def sound(healthy):
    return measure_mocap(healthy.rig, healthy.airframe, healthy.drawn, healthy.scenario)


def measured(context, report):
    context._kept["mocap"] = report
    return context


def turned(pose, by):
    return Pose(pose.position, multiply(by, pose.orientation))


def test_motion_capture_that_describes_vehicle_and_board_passes(context, sound):
    for check in ("mocap.vehicle", "mocap.board"):
        assert result(measured(context, sound), check).outcome is Outcome.PASS


@pytest.mark.parametrize("by", [(HALF, HALF, 0.0, 0.0), (HALF, 0.0, HALF, 0.0), (0.0, 1.0, 0.0, 0.0)])
def test_swapped_axes_fail(context, sound, by):
    report = replace(sound, vehicle=turned(sound.vehicle, by), board=turned(sound.board, by))
    for check in ("mocap.vehicle", "mocap.board"):
        judged = result(measured(context, report), check)
        assert (judged.outcome, "axes swapped" in judged.reason) == (Outcome.FAIL, True)


def test_millimetres_fail(context, sound):
    def thousand(pose):
        return Pose(tuple(1000.0 * v + 100_000.0 for v in pose.position), pose.orientation)

    report = replace(sound, vehicle=thousand(sound.vehicle), board=thousand(sound.board))
    for check in ("mocap.vehicle", "mocap.board"):
        judged = result(measured(context, report), check)
        assert (judged.outcome, "millimetres" in judged.reason) == (Outcome.FAIL, True)


def test_exchanged_bodies_fail(context, sound):
    report = replace(sound, vehicle=sound.board, board=sound.vehicle)
    assert result(measured(context, report), "mocap.board").outcome is Outcome.FAIL


def test_heading_is_compared_where_the_autopilot_has_one_of_its_own(context, sound):
    report = replace(sound, vehicle=turned(sound.vehicle, from_euler(0.0, 0.0, 1.5)))
    assert "heading" in result(measured(context, report), "mocap.vehicle").reason
    aligned = with_slot(context, "vehicle", external_pose=True)
    assert result(measured(aligned, report), "mocap.vehicle").outcome is Outcome.PASS


def test_body_that_is_not_seen_is_unknown(context, sound):
    with pytest.raises(Unavailable, match="does not see the board"):
        result(measured(context, replace(sound, board=None)), "mocap.board")


def curve(context, monkeypatch, seen):
    """The wheels' item with a motion capture that sees the car at `seen(x, y, heading)` = (x, y, heading)."""
    real = with_slot(context, "mocap", kind="vrpn", server="somewhere", board_body="board")
    car = real.car()
    device = car._pace.devices[0].__self__

    class Vrpn:
        def __init__(self, *_):
            pass

        def wait_for_bodies(self):
            return self

        def take(self, now_ns):
            x, y, heading = seen(*device.pose)
            return [BodyPose("board", 0, (x, y, 1.5), from_euler(0.0, -0.5, heading))]

        def close(self):
            pass

    monkeypatch.setattr(bench_mocap, "VrpnMocap", Vrpn)
    return result(real, "mocap.wheels")


def test_car_that_moves_as_its_wheels_passes(context, monkeypatch):
    assert curve(context, monkeypatch, lambda x, y, h: (x, y, h)).outcome is Outcome.PASS


@pytest.mark.parametrize(
    "seen",
    [
        lambda x, y, h: (-x, y, math.pi - h),  # x mirrored
        lambda x, y, h: (x, -y, -h),  # y mirrored
        lambda x, y, h: (y, x, math.pi / 2 - h),  # x and y swapped
        lambda x, y, h: (1000.0 * x, 1000.0 * y, h),  # millimetres
        lambda x, y, h: (x, y, h + math.pi),  # the body is defined back to front
        lambda x, y, h: (1.0, 2.0, 0.3),  # a body that stands
    ],
)
def test_car_that_does_not_move_as_its_wheels_fails(context, monkeypatch, seen):
    judged = curve(context, monkeypatch, seen)
    assert (judged.outcome, "swapped or mirrored" in judged.reason) == (Outcome.FAIL, True)


def test_simulated_motion_capture_does_not_see_the_bench_s_car(context):
    with pytest.raises(NotApplicable, match="does not see a car on the bench"):
        result(context, "mocap.wheels")
