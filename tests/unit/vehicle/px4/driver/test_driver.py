"""The driver against the software PX4: the whole way to the hand-over, body rates, and the way back."""

import math
import statistics
import time
from itertools import pairwise

import pytest

from kernel.rotations import body_z, wrap_angle, yaw
from tests.unit.vehicle.px4.driver.driver_bench import MS, START, Bench
from vehicle.px4 import protocol as px4
from vehicle.px4.driver.types import ExternalPose, LinkConfig, Rates
from vehicle.quadrotor import airframe_row

HOVER = Rates((0.0, 0.0, 0.0), 9.80665)
VISION = {"EKF2_EV_CTRL": 15, "EKF2_GPS_CTRL": 0, "EKF2_HGT_REF": 3, "SENS_EN_GPSSIM": 0, "SYS_HAS_GPS": 0}
VISION |= {"SYS_HAS_MAG": 0, "EKF2_MAG_TYPE": 5}


def hover(_):
    return HOVER


@pytest.fixture(scope="module")
def arrived():
    """One whole sequence, for the tests that only look."""
    return Bench().to("hover")


def test_flight_from_connect_to_hover(arrived):
    bench = arrived
    names = [phase for _, phase in bench.phases]
    assert names == ["connect", "parameters", "streams", "ready", "arm", "takeoff", "goto", "hover"]
    assert bench.seconds < 18.0
    truth = bench.sim.truth()
    assert math.dist(truth.position, START[:3]) < 0.15
    assert abs(wrap_angle(yaw(truth.orientation) - START[3])) < 0.1
    assert bench.speed < 0.1
    assert (bench.out.mode, bench.out.armed, bench.out.connected, bench.out.landed) == ("OFFBOARD", True, True, False)
    assert bench.out.battery_v > 14.0
    assert bench.link.hover_thrust == pytest.approx(bench.out.hover_thrust, rel=0.03)
    assert not [note for _, note in bench.notes if note.severity != "info"]


def test_streams_have_requested_rates_and_sample_times(arrived):
    bench = arrived
    late = [sample for now, sample in bench.odometry if now > bench.now - 2_000 * MS]
    assert len(late) == pytest.approx(200, abs=5)
    gaps = [b.stamp_ns - a.stamp_ns for a, b in pairwise(late)]
    assert statistics.mean(gaps) == pytest.approx(10 * MS, rel=0.03)
    assert bench.link.counters["clock_offset_ns"] == -bench.begin  # exact: PX4 booted when the bench began
    climbing = [s for _, s in bench.odometry if s.velocity[2] > 0.6]
    assert len(climbing) > 100
    for sample in climbing:
        truth = bench.truth[sample.stamp_ns]
        assert math.dist(sample.position, truth.position) < 0.03
        assert math.dist(sample.velocity, truth.velocity) < 0.15
        assert (
            max(abs(a - b) for a, b in zip(body_z(sample.orientation), body_z(truth.orientation), strict=True)) < 0.02
        )


def test_parameters_are_set_as_asked(arrived):
    assert arrived.sim.flight.parameters["COM_OF_LOSS_T"] == pytest.approx(0.3)
    assert arrived.sim.flight.parameters["COM_OBL_RC_ACT"] == 4
    assert arrived.reported("COM_OF_LOSS_T set to 0.3 (was 1)")
    assert arrived.link.parameters["CBRK_FLIGHTTERM"] == 121212


def test_parsing_and_packing_time_is_bounded():
    bench = Bench().to("hover")
    busy, steps = 0, 0

    def timed():
        nonlocal busy, steps
        start = time.process_time_ns()
        bench.step(HOVER if bench.now % (10 * MS) == 0 else None)
        busy += time.process_time_ns() - start
        steps += 1

    end = bench.now + 2_000 * MS
    while bench.now < end:
        if (bench.now - bench.begin) % (4 * MS) == 0:
            bench.sim.step(bench.now)
        timed()
        bench.now += 2 * MS
    assert busy / 2.0 < 50e6, "CPU ns per simulated second, at 100 Hz of commands and odometry"
    assert len(bench.sent) > 150


@pytest.mark.parametrize(
    ("axis", "rate"), [(0, 1.5), (0, -1.5), (1, 1.0), (1, -1.0), (2, 0.8)], ids=lambda value: str(value)
)
def test_commanded_rates_are_reached_in_flu(axis, rate):
    bench = Bench().to("hover")
    wanted = [0.0, 0.0, 0.0]
    wanted[axis] = rate
    bench.run(0.2, hover)
    assert bench.link.phase == "handed_over"
    assert bench.speed < 0.3
    bench.run(0.45, lambda _: Rates((wanted[0], wanted[1], wanted[2]), 9.8))
    reached = bench.sim.truth().body_rate
    assert reached[axis] == pytest.approx(rate, rel=0.15)
    assert max(abs(reached[other]) for other in range(3) if other != axis) < 0.25
    assert len(bench.sent) == 65


@pytest.mark.parametrize("factor", [0.85, 1.0, 1.15])
def test_thrust_is_mass_normalised_by_the_learned_hover(factor):
    """The vehicle is lighter or heavier for its motors than in its file; a commanded m/s^2 stays an m/s^2."""
    from vehicle.quadrotor import airframe as af

    row = af.load_airframe("paper_quad").params_row()
    row[airframe_row.MOTOR_THRUST] *= factor
    bench = Bench(sim={"params_row": row}).to("hover")
    assert bench.out.hover_thrust == pytest.approx(bench.config.hover_thrust / factor, rel=0.02)
    bench.run(0.1, hover)
    before = bench.sim.truth().velocity[2]
    bench.run(0.4, lambda _: Rates((0.0, 0.0, 0.0), 13.0))
    lag = 0.035 + 0.005
    gained = bench.sim.truth().velocity[2] - before
    assert gained == pytest.approx((13.0 - 9.80665) * (0.4 - lag), rel=0.08)


def test_the_wire_carries_frd_rates_and_normalised_thrust():
    bench = Bench().to("hover")
    bench.uplink.clear()
    bench.run(0.05, lambda _: Rates((0.1, 0.2, 0.3), 12.0))
    mav = px4.mavlink.MAVLink(None)
    sent = [m for data in bench.uplink for m in mav.parse_buffer(data) or [] if m.get_type() == "SET_ATTITUDE_TARGET"]
    assert len(sent) == 5
    m = sent[-1]
    assert m.type_mask == 0x80
    assert (m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate) == pytest.approx((0.1, -0.2, -0.3))
    assert m.thrust == pytest.approx(12.0 / 9.80665 * bench.link.hover_thrust, rel=1e-6)
    assert (m.target_system, m.target_component) == (1, 1)
    assert (m.get_srcSystem(), m.get_srcComponent()) == (245, 190)


def test_flight_with_another_px4_origin():
    """PX4's local origin is where it boots; the world's origin is elsewhere."""
    place = (40.0, -25.0, 1.2)
    start = (41.0, -24.0, 4.0, -2.0)
    bench = Bench(sim={"position": place, "origin": place, "yaw": -2.0}, start=start, origin=place).to("hover")
    assert math.dist(bench.sim.truth().position, start[:3]) < 0.15
    assert math.dist(bench.odometry[-1][1].position, bench.sim.truth().position) < 0.03


@pytest.mark.parametrize("delay_ms", [0.0, 3.0, 20.0])
def test_flight_with_other_wire_delays(delay_ms):
    bench = Bench(delay_ms=delay_ms).to("hover")
    assert abs(bench.link.counters["clock_offset_ns"] + bench.begin) <= 2 * MS
    bench.run(0.3, hover)
    assert bench.link.phase == "handed_over"


def test_flight_with_a_px4_slower_than_our_clock():
    """A SITL on a busy machine: our timeouts count PX4's time."""
    bench = Bench(clock_drift=0.03)
    slow, real = bench.sim, bench.sim.step
    slow.step = lambda now: real(bench.begin + (now - bench.begin) // 4)
    bench.to("hover", limit=90.0)
    assert slow.boot_ns * 1e-9 < 18.0
    bench.run(2.0, hover)
    assert bench.link.phase == "handed_over"


def test_driver_flies_on_motion_capture_alone():
    bench = Bench(sim={"parameters": VISION}, external_vision=True)

    def pose():
        truth = bench.sim.truth()
        return ExternalPose(bench.now, truth.position, truth.orientation)

    bench.pose = pose
    bench.to("hover")
    assert math.dist(bench.sim.truth().position, START[:3]) < 0.2
    assert not bench.reported("EKF2")
    assert bench.run(2.0, hover) is False
    bench.link.release()
    assert bench.run(15.0, until=lambda: not bench.sim.flight.armed)


# the way back


def test_land_disarm_and_ready_for_the_next_flight():
    bench = Bench().to("hover")
    bench.run(0.3, hover)
    bench.link.release()
    count = len(bench.sent)
    assert bench.run(20.0, hover, until=lambda: not bench.out.armed)
    assert len(bench.sent) == count, "commands do not count while the autopilot lands"
    assert bench.out.landed
    bench.run(1.0)
    assert bench.sim.flight.intended == px4.HOLD, "else PX4 stays in OFFBOARD and refuses to arm again"
    assert bench.out.phase == "released"
    bench.relink().to("hover")


def test_kill_in_the_air_stops_the_motors_at_once():
    bench = Bench().to("hover")
    bench.run(0.3, hover)
    bench.link.kill()
    bench.run(0.05, hover)
    assert not bench.sim.flight.armed
    bench.run(0.1, hover)
    assert (bench.out.phase, bench.out.armed) == ("killed", False)
    assert bench.sim.truth().velocity[2] < -0.5
    bench.run(1.0, hover)
    assert bench.sim.flight.intended == px4.HOLD, "else PX4 stays in OFFBOARD and refuses to arm again"
    bench.uplink.clear()
    bench.run(1.2, hover)
    assert bench.asked == {"TIMESYNC", "HEARTBEAT"}, "neither is repeated once it is confirmed"


def test_kill_is_repeated_until_the_autopilot_disarms():
    bench = Bench().to("hover")
    bench.stop_reception(True)
    bench.link.kill()
    bench.run(0.3)
    assert bench.sim.flight.armed
    bench.stop_reception(False)
    bench.run(0.2)
    assert not bench.sim.flight.armed


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"start": (0.0, 0.0, math.nan, 0.0)}, "finite"),
        ({"hover_thrust": 1.0}, "0.05 and 0.95"),
        ({"system": 0}, "1 to 255"),
        ({"gap_limit": 0.0}, "gap_limit"),
    ],
)
def test_invalid_configurations_raise(wrong, text):
    with pytest.raises(ValueError, match=text):
        LinkConfig(**({"start": START} | wrong))
