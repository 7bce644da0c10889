"""What a client asks of a flying vehicle besides OFFBOARD: another place, a circle, a pilot's sticks."""

import math

import pytest

from tests.unit.vehicle.px4.sim.client import NAN, Rig
from vehicle.px4 import protocol as px4

REPOSITION, ORBIT = 192, 34


def ask_int(rig, number, params, place, height):
    """COMMAND_INT at a world position (None: no place), and the answers."""
    before = len(rig.answers())
    x, y = (2**31 - 1,) * 2 if place is None else rig.flight.geodetic(*place)
    altitude = NAN if height is None else rig.flight.altitude(height)
    rig.send("COMMAND_INT", 1, 1, 5, number, 0, 0, *params, x, y, altitude)
    rig.run(24)
    return rig.answers()[before:]


def sticks(rig, x=0, y=0, z=500, r=0, target=1):
    rig.send("MANUAL_CONTROL", target, x, y, z, r, 0, 0, 0, *(0,) * 8)


def test_reposition_flies_there_and_turns_the_nose():
    rig = Rig().fly_to_hover()
    assert ask_int(rig, REPOSITION, (-1.0, 1.0, 0.0, math.radians(90)), (8.0, -3.0), 4.0) == [0]
    rig.run(12000)
    assert rig.sim.truth().position == pytest.approx((8.0, -3.0, 4.0), abs=0.4)
    assert rig.of("ATTITUDE")[-1].yaw == pytest.approx(math.radians(90), abs=0.1)
    assert ask_int(rig, REPOSITION, (-1.0, 1.0, 0.0, NAN), None, 2.0) == [0]
    rig.run(6000)
    assert rig.sim.truth().position == pytest.approx((8.0, -3.0, 2.0), abs=0.4)


def test_reposition_without_the_change_of_mode_is_unsupported_and_on_the_ground_nothing_moves():
    rig = Rig()
    assert ask_int(rig, REPOSITION, (-1.0, 0.0, 0.0, NAN), (8.0, 0.0), 4.0) == [3]
    assert ask_int(rig, REPOSITION, (-1.0, 1.0, 0.0, NAN), (8.0, 0.0), 4.0) == [0]
    assert rig.ask(400, 1.0) == [0]
    rig.run(3000)
    assert rig.flight.landed and rig.sim.truth().position == pytest.approx((0.0, 0.0, 0.0), abs=0.01)


@pytest.mark.parametrize("radius", [4.0, -4.0])
def test_orbit_flies_the_circle_at_its_speed_with_the_nose_to_the_centre(radius):
    rig = Rig().fly_to_hover()
    assert ask_int(rig, ORBIT, (radius, 1.5, 0.0, NAN), (3.0, 0.0), 3.0) == [0]
    assert px4.mode_name(rig.flight.active) == "ORBIT"
    rig.run(8000)
    rig.log.clear()
    for _ in range(10):
        rig.run(400)
        (x, y, z), (vx, vy, _), *_ = rig.sim.truth()
        dx, dy = x - 3.0, y
        assert math.hypot(dx, dy) == pytest.approx(4.0, abs=0.5) and z == pytest.approx(3.0, abs=0.3)
        assert math.copysign(1.0, dy * vx - dx * vy) == math.copysign(1.0, radius)
        assert math.hypot(vx, vy) == pytest.approx(1.3, abs=0.4)  # this airframe's drag takes a part of the speed
        heading = math.pi / 2 - rig.of("ATTITUDE")[-1].yaw
        assert math.cos(heading - math.atan2(-dy, -dx)) > 0.95
    told = rig.of("ORBIT_EXECUTION_STATUS")[-1]
    assert told.radius == radius and (told.x, told.y) == rig.flight.geodetic(3.0, 0.0)
    assert rig.mode(4, 3)[-1] == 0


def test_orbit_without_a_position_is_rejected_and_keeps_within_px4s_limits():
    rig = Rig().fly_to_hover()
    assert ask_int(rig, ORBIT, (1e9, 1e9, 9.0, NAN), None, None) == [0]
    assert rig.sim.commander.orbit.radius == rig.flight.parameters["MC_ORBIT_RAD_MAX"]
    assert ask_int(rig, ORBIT, (math.inf, NAN, math.inf, NAN), None, None) == [0]
    rig.sim.set_gps(False)
    rig.run(8000)
    assert px4.mode_name(rig.flight.active) == "ALTCTL" and rig.flight.failsafe
    assert ask_int(rig, ORBIT, (3.0, 1.0, 0.0, NAN), None, None) == [1]
    assert "Orbit command rejected" in rig.texts()


def test_pilot_takes_off_moves_and_lands_in_position_mode():
    rig = Rig()
    rig.run(200, every=lambda: sticks(rig))
    assert rig.mode(3)[-1] == 0
    rig.run(100, every=lambda: sticks(rig))
    assert rig.ask(400, 1.0) == [0]
    rig.run(6000, every=lambda: sticks(rig, z=800))
    assert rig.sim.truth().position[2] > 1.5 and rig.flight.active == px4.POSCTL
    rig.run(2000, every=lambda: sticks(rig))
    x, y, _ = rig.sim.truth().position
    rig.run(2500, every=lambda: sticks(rig, x=400))  # the vehicle faces east
    east, north, _ = rig.sim.truth().position
    assert east - x > 2.0 and abs(north - y) < 0.5
    rig.run(3000, every=lambda: sticks(rig))
    assert math.hypot(*rig.sim.truth().velocity) < 0.2
    before = rig.of("ATTITUDE")[-1].yaw
    rig.run(1000, every=lambda: sticks(rig, r=500))
    assert rig.of("ATTITUDE")[-1].yaw > before + 0.2, "turned to the right"
    rig.run(12000, every=lambda: sticks(rig, z=0))
    assert not rig.flight.armed and "Landing detected\t" in rig.texts()


def test_pilot_pushes_the_vehicle_in_altitude_mode_which_holds_its_height():
    rig = Rig().fly_to_hover()
    rig.run(100, every=lambda: sticks(rig))
    assert rig.mode(2)[-1] == 0
    rig.run(1500, every=lambda: sticks(rig))
    height = rig.sim.truth().position[2]
    rig.run(1500, every=lambda: sticks(rig, y=500))  # to the right of east: south
    (_, _, z), (vx, vy, _), *_ = rig.sim.truth()
    assert vy < -1.0 and abs(vx) < 0.5 and z == pytest.approx(height, abs=0.4)


def test_lost_sticks_hold_then_return_and_sticks_that_come_again_take_over():
    rig = Rig().fly_to_hover()
    rig.run(100, every=lambda: sticks(rig))
    assert rig.mode(3)[-1] == 0
    rig.run(1000, every=lambda: sticks(rig))
    rig.run(800)
    assert rig.flight.active == px4.HOLD and rig.flight.failsafe and "Manual control lost\t" in rig.texts()
    rig.run(300, every=lambda: sticks(rig))
    assert rig.flight.active == px4.POSCTL and not rig.flight.failsafe
    rig.run(6000)
    assert rig.flight.active == px4.RTL


def test_sticks_out_of_range_for_others_or_above_the_centre_do_not_arm_or_move():
    rig = Rig()
    rig.run(100, every=lambda: sticks(rig, target=9))
    assert not rig.sim.commander.sticks
    rig.run(100, every=lambda: sticks(rig, x=1001, y=-32768, z=900, r=2000))
    assert rig.mode(3)[-1] == 0
    sticks(rig, z=900)
    assert rig.ask(400, 1.0) == [1] and "Arming denied: throttle above center\t" in rig.texts()
    assert rig.sim.commander.manual._sticks[:2] == (0.0, 0.0)


def test_place_that_is_not_on_earth_is_no_place():
    rig = Rig().fly_to_hover()
    assert rig.ask(ORBIT, 3.0, 1.0, 0.0, NAN, 1e9, 8.5, NAN) == [0]
    assert rig.sim.commander.orbit.centre[:2] == pytest.approx(rig.sim.truth().position[:2], abs=0.3)
    assert rig.flight.geodetic(1e12, -1e12) == (-(2**31), 2**31 - 1)


@pytest.mark.parametrize("number", [211, 241, 209, 42600, 1000])
def test_what_the_software_px4_has_not_is_unsupported(number):
    assert Rig().ask(number, 1.0) == [3]


def test_follow_me_is_not_available():
    rig = Rig().fly_to_hover()
    assert rig.mode(4, 8) == [0, 1] and rig.flight.active == px4.HOLD


def test_command_int_with_a_nan_for_an_integer_is_denied():
    rig = Rig()
    rig.send("COMMAND_INT", 1, 1, 5, REPOSITION, 0, 0, -1.0, 1.0, 0.0, NAN, 0x7FF80000, 0x7FF80000, 0.0)
    rig.run(24)
    assert rig.answers() == [2]
