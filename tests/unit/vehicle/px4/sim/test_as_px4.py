"""Where clients have found the software PX4 to differ from a real v1.17: the real one's values."""

import math

import numpy as np
import pytest

from kernel.rotations import yaw
from tests.unit.vehicle.px4.sim.client import NAN, Rig
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.navigator import braking_speed

VELOCITY = int(px4.PositionMask.POSITION | px4.PositionMask.ACCELERATION | px4.PositionMask.YAW_RATE)
VELOCITY_NO_YAW = VELOCITY | int(px4.PositionMask.YAW)


def velocity(rig, x, y, z, frame=1, mask=VELOCITY, heading=0.0):
    rig.send(
        "SET_POSITION_TARGET_LOCAL_NED", rig.ms, 1, 1, frame, mask, *(0.0,) * 3, x, y, z, *(0.0,) * 3, heading, 0.0
    )


def in_offboard(rig, setpoint):
    """Hovering rig, in OFFBOARD with `setpoint` () streaming at 50 Hz."""
    rig.run(100, setpoint)
    assert rig.mode(6) == [0, 0]
    return rig


def test_body_rates_are_as_noisy_as_measured():
    """Sample to sample, of ODOMETRY at 100 Hz of an armed vehicle at hover: roll, pitch, yaw, rad/s."""
    rig = Rig(frame="paper_quad")
    rig.run(4000)
    rates = np.array([(m.rollspeed, m.pitchspeed, m.yawspeed) for m in rig.of("ODOMETRY")])
    jumps = np.sqrt(np.mean(np.diff(rates, axis=0) ** 2, axis=0))
    assert jumps == pytest.approx([0.11, 0.055, 0.022], rel=0.25)


def test_take_off_to_twelve_metres_climbs_as_measured():
    """Heights and climb rates of a real firmware, by seconds after the command."""
    rig = Rig(frame="paper_quad")
    rig.command(400, 1.0)
    rig.send("PARAM_SET", 1, 1, "MIS_TAKEOFF_ALT", 12.0, 9)
    rig.run(1000)
    rig.ask(22, NAN, 0.0, 0.0, NAN, NAN, NAN, NAN)
    measured = {3: (0.0, 0.07), 4: (0.5, 0.88), 5: (1.64, 1.27), 6: (2.95, 1.35), 8: (5.77, 1.45), 10: (8.72, 1.49)}
    now_s = 0
    for second, (height, climb) in measured.items():
        rig.run((second - now_s) * 1000)
        now_s = second
        truth = rig.sim.truth()
        assert truth.position[2] == pytest.approx(height, abs=0.9), second
        assert truth.velocity[2] == pytest.approx(climb, abs=0.35), second


@pytest.mark.parametrize("distance", [0.1, 1.0, 8.0])
def test_braking_speed_is_that_of_limited_acceleration_and_jerk(distance):
    speed = braking_speed(distance, 2.0, 4.0)
    assert speed * speed + 4.0 * speed == pytest.approx(2.0 * 2.0 * distance), "PX4's parabola with 4 a^2 / j"
    assert braking_speed(0.0, 2.0, 4.0) == 0.0


def test_offboard_take_off_waits_for_a_set_point_above_the_ground():
    rig = Rig()
    rig.run(100, lambda: rig.goto(0.0, 0.0, 0.3))
    rig.mode(6)
    rig.command(400, 1.0)
    rig.run(4000, lambda: rig.goto(0.0, 0.0, 0.3))
    assert rig.flight.armed and rig.flight.landed and not any(rig.sim.truth().motors), "below it: the motors rest"
    rig.run(6000, lambda: rig.goto(0.0, 0.0, -3.0))
    assert rig.sim.truth().position[2] > 2.0


def test_landing_by_a_velocity_set_point_is_detected_and_disarms():
    rig = Rig().fly_to_hover()
    in_offboard(rig, lambda: velocity(rig, 0.0, 0.0, 0.5))
    rig.run(12_000, lambda: velocity(rig, 0.0, 0.0, 0.5))
    assert [t for t in rig.texts() if "anding detected" in t or "Disarmed" in t] == [
        "Landing detected\t",
        "Disarmed by landing\t",
    ]
    assert not rig.flight.armed


def test_slow_descent_onto_the_ground_is_no_landing():
    """Slower than 1.1 LNDMC_Z_VEL_MAX it cannot be told from standing."""
    rig = Rig().fly_to_hover()
    in_offboard(rig, lambda: velocity(rig, 0.0, 0.0, 0.2))
    rig.run(20_000, lambda: velocity(rig, 0.0, 0.0, 0.2))
    assert rig.flight.armed


def test_body_frame_velocities_are_turned_by_the_heading():
    rig = Rig(yaw=0.6).fly_to_hover()
    in_offboard(rig, lambda: velocity(rig, 1.0, 0.5, 0.0, frame=8, mask=VELOCITY_NO_YAW))
    rig.run(4000, lambda: velocity(rig, 1.0, 0.5, 0.0, frame=8, mask=VELOCITY_NO_YAW))
    truth = rig.sim.truth()
    course = math.atan2(truth.velocity[1], truth.velocity[0])
    assert math.hypot(*truth.velocity[:2]) == pytest.approx(math.hypot(1.0, 0.5), abs=0.25)
    assert course == pytest.approx(yaw(truth.orientation) - math.atan2(0.5, 1.0), abs=0.1), "forward and to the right"


def test_unsupported_frame_and_empty_set_point_are_told():
    rig = Rig()
    velocity(rig, 1.0, 0.0, 0.0, frame=9)
    velocity(rig, 1.0, 0.0, 0.0, mask=0x1FF)
    velocity(rig, 1.0, 0.0, 0.0, mask=VELOCITY & ~0x1C0 | 0x200)
    rig.run(40)
    assert rig.texts() == [
        "SET_POSITION_TARGET_LOCAL_NED coordinate frame 9 unsupported\t"[:50],
        "SET_POSITION_TARGET_LOCAL_NED coordinate frame 9 unsupported\t"[50:],
        "SET_POSITION_TARGET_LOCAL_NED invalid\t",
        "SET_POSITION_TARGET_LOCAL_NED force not supported\t",
    ]
    assert rig.sim.rejected["setpoints"] == 3


def test_version_is_that_of_the_release_in_px4s_byte_order():
    rig = Rig()
    rig.ask(520, 1.0)
    m = rig.of("AUTOPILOT_VERSION")[-1]
    custom = bytes(m.flight_custom_version)
    assert custom[:3] == bytes(3), "vendor version 0.0.0"
    assert custom[:2:-1].hex() == "d6f12ad1c4", "of the git hash, least byte first"
    assert m.flight_sw_version == 0x011100FF


def test_imu_stream_is_no_faster_than_the_imu():
    rig = Rig()
    assert rig.ask(511, 105.0, 5000.0) == [0]
    rig.log.clear()
    rig.run(2000)
    assert len(rig.of("HIGHRES_IMU")) == pytest.approx(248, abs=3)
