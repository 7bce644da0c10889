"""OFFBOARD: what counts as a stream, how it flies, what happens when it stops."""

import math
from functools import partial

import numpy as np
import pytest

from kernel.rotations import from_euler, swap_attitude
from tests.unit.vehicle.px4.sim.client import NAN, Rig
from vehicle.px4 import protocol as px4
from vehicle.quadrotor import state_row

ACCEPTED, REJECTED = 0, 1


def airborne(**options):
    """In OFFBOARD rates a few metres up, streaming at 50 Hz so far."""
    rig = Rig(**options)
    rig.run(200, rig.rates)
    assert rig.mode(6) == [ACCEPTED, ACCEPTED]
    rig.rates()
    assert rig.ask(400, 1.0) == [ACCEPTED]
    rig.run(1500, lambda: rig.rates(thrust=0.6))
    rig.run(300, lambda: rig.rates(thrust=0.4903))
    rig.log.clear()
    return rig


def test_one_recent_setpoint_is_enough_to_arm():
    rig = Rig()
    rig.rates()
    rig.run(4)
    assert rig.mode(6) == [ACCEPTED, ACCEPTED]
    assert rig.ask(400, 1.0) == [ACCEPTED]
    late = Rig()
    late.rates()
    late.mode(6)
    late.run(1000)
    assert late.ask(400, 1.0) == [REJECTED]


@pytest.mark.parametrize("mask", [0x80, 0x00, 0x07, 0x84, 0xC0, 0xA0])
def test_masks_that_keep_offboard_are_accepted(mask):
    rig = Rig()
    rig.run(100, lambda: rig.rates(mask=mask))
    rig.mode(6)
    assert rig.ask(400, 1.0) == [ACCEPTED]


@pytest.mark.parametrize("mask", [0x81, 0x82, 0x87])
def test_masks_that_do_not_keep_offboard_are_ignored(mask):
    rig = Rig()
    rig.run(100, lambda: rig.rates(mask=mask))
    rig.mode(6)
    assert rig.ask(400, 1.0) == [REJECTED]
    assert rig.sim.rejected["setpoints"] > 0


@pytest.mark.parametrize(
    ("system", "component", "received"), [(0, 0, True), (1, 0, True), (2, 1, False), (1, 5, False)]
)
def test_setpoints_for_other_systems_are_ignored(system, component, received):
    rig = Rig()
    rig.run(100, lambda: rig.rates(system=system, component=component))
    rig.mode(6)
    assert rig.ask(400, 1.0) == [ACCEPTED if received else REJECTED]


def test_no_spool_up_and_takeoff_is_detected_in_a_fifth_of_a_second():
    rig = Rig()
    rig.run(1000, rig.rates)
    rig.mode(6)
    rig.rates()
    rig.command(400, 1.0)
    rig.run(12)
    armed = rig.flight.armed_ns / 1e6
    rig.run(16, lambda: rig.rates(thrust=0.6), 4)
    assert rig.sim.view.servos()[0] > 1500
    rig.run(500, lambda: rig.rates(thrust=0.6))
    detected = next(ms for ms, f in rig.log if f.name == "STATUSTEXT" and f.fields.text == "Takeoff detected\t")
    assert detected - armed == pytest.approx(210, abs=40)
    assert rig.sim.truth().position[2] > 0.1


def test_offboard_on_the_ground_disarms_after_ten_seconds_of_no_thrust():
    rig = Rig()
    rig.run(100, rig.rates)
    rig.mode(6)
    rig.ask(400, 1.0)
    rig.run(10100, rig.rates)
    assert not rig.flight.armed


@pytest.mark.parametrize(
    ("command", "axis", "sign"), [({"roll": 1.0}, 0, 1), ({"pitch": 1.0}, 1, -1), ({"yaw": 1.0}, 2, -1)]
)
def test_rates_are_frd(command, axis, sign):
    rig = airborne()
    rig.run(300 if axis < 2 else 1500, lambda: rig.rates(thrust=0.49, **command))
    rates = np.array(rig.sim.truth().body_rate)
    assert sign * rates[axis] > 0.85
    name = ("rollspeed", "pitchspeed", "yawspeed")[axis]
    assert getattr(rig.of("ATTITUDE")[-1], name) > 0.85
    target = rig.of("ATTITUDE_TARGET")[-1]
    assert (target.body_roll_rate, target.body_pitch_rate, target.body_yaw_rate)[axis] == 1.0


def test_positive_roll_goes_east_when_facing_north_and_positive_pitch_goes_back():
    for roll, pitch, axis, sign in ((0.5, 0.0, 0, 1), (0.0, 0.5, 1, -1)):
        rig = airborne(yaw=math.pi / 2)  # facing north
        rig.run(600, partial(rig.rates, roll, pitch, thrust=0.5))
        assert sign * rig.sim.truth().velocity[axis] > 0.1


def test_thrust_is_linear_and_a_missing_throttle_is_none():
    rig = airborne()
    for thrust, mask in ((0.3, 0x80), (0.7, 0x80), (0.7, 0xC0)):
        rig.run(400, lambda thrust=thrust, mask=mask: rig.rates(thrust=thrust, mask=mask))
        expected = 0.0 if mask == 0xC0 else thrust
        assert rig.sim.row[state_row.MOTOR : state_row.MOTOR + 4].mean() == pytest.approx(expected, abs=0.01)


def test_attitude_target_keeps_a_stale_thrust_while_rates_are_flown():
    rig = airborne()
    rig.run(300, lambda: rig.rates(thrust=0.45))
    a = rig.of("ATTITUDE_TARGET")[-1]
    rig.run(300, lambda: rig.rates(thrust=0.55))
    b = rig.of("ATTITUDE_TARGET")[-1]
    assert (a.thrust, a.q, a.type_mask) == (b.thrust, b.q, 0)
    assert rig.of("SERVO_OUTPUT_RAW")[-1].servo1_raw == pytest.approx(1550, abs=20)


def test_attitude_setpoints_are_flown_and_shown_in_the_heartbeat():
    rig = airborne()
    lean = swap_attitude(from_euler(0.0, 0.2, 0.5))  # nose down, in ENU from FLU
    rig.run(2500, lambda: rig.rates(mask=0x07, thrust=0.5, q=lean))
    assert rig.of("HEARTBEAT")[-1].base_mode == 0x91
    q = rig.sim.truth().orientation
    wanted = from_euler(0.0, 0.2, 0.5)
    assert abs(sum(a * b for a, b in zip(q, wanted, strict=True))) > 0.9995


def test_position_setpoints_fly_there_and_hold_yaw():
    rig = airborne(parameters={"MPC_XY_VEL_MAX": 3.0})
    rig.run(8000, lambda: rig.goto(3.0, -2.0, -3.0, yaw=1.0), 40)
    truth = rig.sim.truth()
    assert truth.position == pytest.approx((-2.0, 3.0, 3.0), abs=0.1)
    assert np.abs(truth.velocity).max() < 0.1
    assert rig.of("ATTITUDE")[-1].yaw == pytest.approx(1.0, abs=0.05)
    assert rig.of("POSITION_TARGET_LOCAL_NED")[-1].x == pytest.approx(3.0)


def test_velocity_setpoints_are_flown():
    rig = airborne()
    mask = px4.PositionMask.POSITION | px4.PositionMask.ACCELERATION | px4.PositionMask.YAW_RATE
    for _ in range(400):
        rig.send("SET_POSITION_TARGET_LOCAL_NED", 0, 1, 1, 1, mask, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0, *(0.0,) * 5)
        rig.run(40)
    assert rig.sim.truth().velocity == pytest.approx((0.5, 1.0, 0.0), abs=0.1)


def test_takeoff_by_position_setpoint():
    rig = Rig(frame="paper_quad")
    rig.run(200, lambda: rig.goto(0.0, 0.0, -2.0), 40)
    rig.mode(6)
    assert rig.ask(400, 1.0) == [ACCEPTED]
    rig.run(9000, lambda: rig.goto(0.0, 0.0, -2.0), 40)
    assert rig.sim.truth().position == pytest.approx((0.0, 0.0, 2.0), abs=0.1)


@pytest.mark.parametrize("frame_id", [8, 9, 7])
def test_position_setpoints_in_other_frames_do_not_count(frame_id):
    rig = Rig()
    rig.send("SET_POSITION_TARGET_LOCAL_NED", 0, 1, 1, frame_id, px4.POSITION_YAW, *(0.0,) * 11)
    rig.run(8)
    assert rig.sim.rejected["setpoints"] == 1 and rig.flight.setpoint.last_ns < 0


def test_nan_and_infinity_are_rejected_and_counted():
    rig = airborne()
    rig.rates(thrust=NAN)
    rig.rates(roll=math.inf)
    rig.rates(mask=0x07, q=(NAN, 0.0, 0.0, 0.0))
    rig.run(8)
    assert rig.sim.rejected["setpoints"] == 3
    assert np.isfinite(rig.sim.row).all()


@pytest.mark.parametrize(("hz", "stays"), [(1.2, True), (0.8, False)])
def test_only_streams_above_the_minimum_rate_keep_offboard(hz, stays):
    rig = airborne()
    rig.run(5000, lambda: rig.rates(thrust=0.4903), round(1000 / hz / 4) * 4)
    failed = "Failsafe activated\t" in rig.texts()
    assert failed != stays


@pytest.mark.parametrize(("loss", "seed"), [(1.0, 1), (1.0, 2), (0.3, 3)])
def test_lost_stream_enters_failsafe_100_ms_after_the_limit(loss, seed):
    rig = airborne(parameters={"COM_OF_LOSS_T": loss}, seed=seed)
    rig.run(40 + 4 * seed, lambda: rig.rates(thrust=0.4903), 4)
    last = rig.flight.setpoint.last_ns
    rig.run(round(loss * 1000) + 300)
    fell = 1_000_000 * next(
        ms for ms, f in rig.log if f.name == "STATUSTEXT" and f.fields.text == "Failsafe activated\t"
    )
    assert round((loss + 0.100) * 1e9) <= fell - last <= round((loss + 0.120) * 1e9)


@pytest.mark.parametrize(
    ("action", "mode"), [(0, px4.RTL), (1, px4.RTL), (2, px4.RTL), (3, px4.RTL), (4, px4.LAND), (5, px4.HOLD)]
)
def test_mode_after_a_lost_stream_follows_its_parameter(action, mode):
    rig = airborne(parameters={"COM_OBL_RC_ACT": action})
    rig.run(2200)
    m = rig.of("HEARTBEAT")[-1]
    assert (m.base_mode, m.custom_mode, m.system_status) == (0x9D, mode, 5)


def test_terminate_and_disarm_as_reactions_stop_the_motors():
    for action in (6, 7):
        rig = airborne(parameters={"COM_OBL_RC_ACT": action})
        rig.run(1300)
        assert rig.of("SERVO_OUTPUT_RAW")[-1].servo1_raw == 900
        assert rig.flight.terminated == (action == 6)


def test_without_a_position_the_fallback_is_altitude():
    rig = airborne(parameters={"SENS_EN_GPSSIM": 0, "SYS_HAS_GPS": 0})
    rig.run(2200)
    m = rig.of("HEARTBEAT")[-1]
    assert (m.base_mode, m.custom_mode, m.system_status) == (0xD1, px4.ALTCTL, 5)
    height = rig.sim.truth().position[2]
    rig.run(3000)
    assert rig.sim.truth().position[2] == pytest.approx(height, abs=0.5)


def test_mode_requested_in_failsafe_stays():
    rig = airborne()
    rig.run(2000)
    assert rig.flight.active == px4.RTL and rig.flight.failsafe
    assert rig.mode(4, 3) == [ACCEPTED, ACCEPTED]
    rig.run(1000, lambda: rig.rates(thrust=0.3))
    assert rig.flight.active == px4.HOLD and not rig.flight.failsafe


def test_hold_requested_while_streaming_ignores_the_stream():
    rig = airborne()
    height = rig.sim.truth().position[2]
    rig.mode(4, 3)
    rig.run(3000, lambda: rig.rates(thrust=0.9))
    assert rig.sim.truth().position[2] == pytest.approx(height, abs=1.5)


def test_after_landing_the_mode_falls_back_to_offboard():
    rig = airborne()
    rig.ask(21, 0.0, 0.0, 0.0, NAN, NAN, NAN, NAN)
    rig.run(16000)
    assert not rig.flight.armed
    m = rig.of("HEARTBEAT")[-1]
    assert (m.base_mode, m.custom_mode, m.system_status) == (0x01, px4.OFFBOARD, 0)
    assert rig.ask(400, 1.0) == [REJECTED]
    rig.mode(4, 3)
    assert rig.ask(400, 1.0) == [ACCEPTED]


def test_current_mode_on_request_shows_intended_and_actual():
    rig = airborne()
    assert rig.ask(511, 436.0, 20000.0) == [ACCEPTED]
    rig.log.clear()
    rig.run(2000)
    modes = rig.of("CURRENT_MODE")
    assert len(modes) == pytest.approx(100, abs=2)
    assert (modes[-1].custom_mode, modes[-1].intended_custom_mode) == (px4.RTL, px4.OFFBOARD)


def test_failure_detector_terminates_only_without_its_breaker():
    for breaker, terminated in ((121212, False), (0, True)):
        rig = airborne(parameters={"CBRK_FLIGHTTERM": breaker})
        rig.run(1300, partial(rig.rates, pitch=1.5, thrust=0.6))
        assert rig.flight.terminated == terminated
