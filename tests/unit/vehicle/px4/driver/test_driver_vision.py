"""Poses of motion capture on their way into PX4's estimator."""

import math

import pytest

from kernel.rotations import from_euler, multiply, swap_attitude, to_euler, yaw
from tests.unit.vehicle.px4.driver.driver_bench import MS, Bench
from vehicle.px4 import protocol as px4
from vehicle.px4.driver.arming import Arming
from vehicle.px4.driver.types import ExternalPose

VISION = {"EKF2_EV_CTRL": 15, "EKF2_GPS_CTRL": 0, "EKF2_HGT_REF": 3, "SENS_EN_GPSSIM": 0, "SYS_HAS_GPS": 0}
NAN = math.nan


def fed(pose, seconds=5.0, **options):
    """A bench on the ground, with `pose` (bench) given in every step of the driver."""
    bench = Bench(arm=False, **options)
    bench.pose = lambda: pose(bench)
    bench.run(seconds)
    return bench


def odometries(bench):
    """What went out, as pymavlink reads it."""
    mav = px4.mavlink.MAVLink(None)
    messages = [m for data in bench.uplink for m in mav.parse_buffer(data) or []]
    return [m for m in messages if m.get_type() == "ODOMETRY"]


def truth(bench, shift=(0.0, 0.0, 0.0), turn=0.0):
    true = bench.sim.truth()
    position = tuple(p + s for p, s in zip(true.position, shift, strict=True))
    return ExternalPose(bench.now, position, multiply(from_euler(0.0, 0.0, turn), true.orientation))


def test_external_poses_are_sent_in_px4s_frames():
    place = (10.0, 20.0, 1.0)
    attitude = from_euler(0.1, -0.2, 0.3)
    pose = ExternalPose(0, (12.0, 23.0, 5.0), attitude)
    bench = fed(lambda b: pose._replace(stamp_ns=b.now - 5 * MS), origin=place)
    sent = odometries(bench)
    m = sent[-1]
    assert (m.frame_id, m.child_frame_id, m.estimator_type) == (1, 12, 3)
    assert (m.x, m.y, m.z) == pytest.approx((3.0, 2.0, -4.0)), "north, east, down from PX4's origin"
    assert m.q == pytest.approx(swap_attitude(attitude), abs=1e-6)
    roll, pitch, heading = to_euler(tuple(m.q))
    assert (roll, pitch) == pytest.approx((0.1, 0.2), abs=1e-6)
    assert heading == pytest.approx(math.pi / 2 - 0.3, abs=1e-6)
    assert math.isnan(m.vx) and math.isnan(m.rollspeed)
    assert abs(m.time_usec * 1000 - (bench.now - 5 * MS)) < 25 * MS, "the time of the pose, on our clock"


def test_external_poses_are_sent_at_most_at_50_hz():
    bench = fed(lambda b: truth(b))
    bench.uplink.clear()
    bench.run(4.0)
    assert len(odometries(bench)) == pytest.approx(200, abs=4), "of 2000 given"
    slow = fed(lambda b: truth(b) if b.now % (50 * MS) == 0 else None)
    slow.uplink.clear()
    slow.run(4.0)
    assert len(odometries(slow)) == 80, "of 80 given"


@pytest.mark.parametrize("bad", [(NAN, 0.0, 0.0), (0.0, math.inf, 0.0)])
def test_a_pose_that_is_not_finite_is_not_passed_on(bad):
    bench = fed(lambda b: ExternalPose(b.now, bad, (1.0, 0.0, 0.0, 0.0)))
    assert odometries(bench) == []
    bench = fed(lambda b: ExternalPose(b.now, (0.0, 0.0, 0.0), (NAN, 0.0, 0.0, 0.0)))
    assert odometries(bench) == []


def test_px4s_estimate_follows_with_parameters_set_before_boot():
    shift, turn = (0.5, -0.4, 0.3), 0.1
    bench = fed(lambda b: truth(b, shift, turn), seconds=8.0, sim={"parameters": VISION}, external_vision=True)
    believed, true = bench.odometry[-1][1], bench.sim.truth()
    for axis in range(3):
        assert believed.position[axis] == pytest.approx(true.position[axis] + shift[axis], abs=0.03)
    assert yaw(believed.orientation) == pytest.approx(yaw(true.orientation) + turn, abs=0.03)


def test_px4s_estimate_does_not_follow_without_the_parameters():
    bench = fed(lambda b: truth(b, (0.5, -0.4, 0.3)), seconds=8.0)
    believed, true = bench.odometry[-1][1], bench.sim.truth()
    assert math.dist(believed.position, true.position) < 0.05


def test_checked_autopilot_on_external_vision_is_armed_in_offboard():
    bench = fed(truth, seconds=8.0, sim={"parameters": VISION}, external_vision=True)
    bench.link.allow_arming(Arming(parameters={"EKF2_EV_CTRL": 15}))
    bench.to("verify").to("hover")
