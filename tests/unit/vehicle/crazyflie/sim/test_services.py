"""The software Crazyflie's services: tables, log blocks, parameters, commanders, external poses, battery."""

import itertools
import math
import struct

import pytest

from tests.unit.vehicle.crazyflie.sim.client import Rig
from vehicle.crazyflie import commands
from vehicle.crazyflie.commands import GoTo, Rates, Vertical
from vehicle.crazyflie.crtp import Errno, Log, LogControl, Packet, ParameterCommand, Parameters, Port
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.crazyflie.sim.high_level import HighLevel
from vehicle.crazyflie.table import PARAMETER_KINDS, read_info, read_item
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import load_airframe

HOVER = 41650


def test_parameters_are_read_written_and_refused():
    rig = Rig()
    count, _ = read_info(rig.ask(Packet(Port.PARAMETERS, Parameters.TABLE, b"\x03"))[0])
    names = {}
    for number in range(count):
        item = rig.ask(Packet(Port.PARAMETERS, Parameters.TABLE, struct.pack("<BH", 2, number)))[0]
        names[read_item(item, PARAMETER_KINDS)[1].full] = number
    timeout = names["supervisor.prefltTimeout"]
    write = struct.pack("<HH", timeout, 1234)
    assert rig.ask(Packet(Port.PARAMETERS, Parameters.WRITE, write)) == [write]
    read = rig.ask(Packet(Port.PARAMETERS, Parameters.READ, struct.pack("<H", timeout)))
    assert read == [struct.pack("<HBH", timeout, 0, 1234)]
    assert rig.flight.supervisor.preflight_timeout_ns == 1_234_000_000
    default = rig.ask(
        Packet(Port.PARAMETERS, Parameters.OTHER, struct.pack("<BH", ParameterCommand.GET_DEFAULT, timeout))
    )
    assert default == [struct.pack("<BHBH", ParameterCommand.GET_DEFAULT, timeout, 0, 30000)]
    unknown = rig.ask(Packet(Port.PARAMETERS, Parameters.READ, struct.pack("<H", 9999)))
    assert unknown == [struct.pack("<HB", 9999, Errno.NO_ENTRY)]
    assert rig.ask(Packet(Port.PARAMETERS, Parameters.WRITE, struct.pack("<HI", names["firmware.revision0"], 1))) == []


def test_log_blocks_come_at_100_hz_with_the_device_s_time():
    rig = Rig()
    rig.log(["stateEstimate.x", "pm.vbat"])
    rig.run(1000)
    rows = rig.data()
    assert len(rows) >= 98
    assert {b[0] - a[0] for a, b in itertools.pairwise(rows)} == {10}
    assert all(3.5 < values[1] < 4.2 for _, values in rows)


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (bytes((LogControl.START_MS, 9)) + b"\x0a\x00", Errno.NO_ENTRY),
        (bytes((LogControl.CREATE, 1)) + struct.pack("<BH", 7, 9999), Errno.NO_ENTRY),
        (bytes((LogControl.CREATE, 1)) + struct.pack("<BH", 7, 0) * 7, Errno.TOO_BIG),
        (bytes((77, 1)), Errno.NO_COMMAND),
    ],
)
def test_log_commands_that_cannot_be_done_are_answered_with_their_error(data, error):
    assert Rig().ask(Packet(Port.LOG, Log.CONTROL, data)) == [bytes((data[0], data[1], error))]


def test_log_block_that_exists_is_not_created_twice():
    rig = Rig()
    rig.log(["pm.vbat"])
    rig.run(10)
    create = bytes((LogControl.CREATE, 1))
    assert rig.ask(Packet(Port.LOG, Log.CONTROL, create))[0] == create + bytes((Errno.EXISTS,))
    assert rig.ask(Packet(Port.LOG, Log.CONTROL, bytes((LogControl.RESET,))))[0][0] == LogControl.RESET
    rig.received.clear()
    rig.run(50)
    assert rig.data() == []


def test_take_off_flight_and_landing_of_the_high_level_commander():
    rig = Rig()
    rig.take_off(1.0)
    assert rig.sim.truth().position[2] == pytest.approx(1.0, abs=0.1)
    rig.send(commands.go_to(GoTo(False, (1.0, -0.5, 1.5), 1.0, 3.0)))
    rig.run(5000)
    assert rig.sim.truth().position == pytest.approx((1.0, -0.5, 1.5), abs=0.1)
    assert rig.flight.heading == pytest.approx(1.0, abs=0.1)
    rig.send(commands.vertical(Vertical(True, 0.0, None, 3.0)))
    rig.run(4500)
    assert rig.sim.truth().position[2] == pytest.approx(0.0, abs=0.02)
    assert max(rig.sim.truth().motors) < 0.05


def test_high_level_commander_is_busy_while_it_may_not_fly():
    answer = Rig().ask(commands.vertical(Vertical(False, 1.0, None, 2.0)))
    assert [data[3] for data in answer] == [Errno.BUSY]


def test_planned_flight_begins_and_ends_at_rest():
    plan = HighLevel()
    plan.tell((0.0, 0.0, 1.0), 0.0)
    assert plan.command(0, GoTo(False, (2.0, 0.0, 1.0), 0.0, 4.0), can_fly=True) == 0
    points = [plan.setpoint(at * 10_000_000, (0.0, 0.0, 0.0), 0.0)[0] for at in range(401)]
    speeds = [point.velocity[0] for point in points]
    assert (points[0].position[0], points[-1].position[0]) == pytest.approx((0.0, 2.0))
    assert (speeds[0], speeds[-1]) == (0.0, 0.0)
    assert max(speeds) == pytest.approx(35 / 16 * 2.0 / 4.0, rel=1e-3)
    moved = sum(speed * 0.01 for speed in speeds)
    assert moved == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rates_turn_it_the_way_that_was_asked(axis):
    rig = Rig()
    rig.take_off(1.5)
    rate = [0.0, 0.0, 0.0]
    rate[axis] = 1.0
    rig.run(250, lambda: rig.send(commands.rates(Rates(tuple(rate), HOVER))), 10)
    assert rig.sim.truth().body_rate[axis] == pytest.approx(1.0, abs=0.3)


def test_legacy_rate_set_points_need_rate_mode_and_an_unlocked_thrust():
    rig = Rig()
    rig.take_off(1.5)
    for name in ("Roll", "Pitch"):
        number = rig.sim.receiver._parameters.contents.numbers[f"flightmode.stabMode{name}"]
        rig.send(Packet(Port.PARAMETERS, Parameters.WRITE, struct.pack("<HB", number, 0)))

    def legacy(word):
        rig.send(Packet(Port.SETPOINT, 0, struct.pack("<fffH", math.degrees(0.8), 0.0, 0.0, word)))

    legacy(HOVER)
    rig.run(4)
    assert rig.flight.commander.setpoint.word == 0
    legacy(0)
    rig.run(4)
    rig.run(200, lambda: legacy(HOVER), 10)
    assert rig.flight.commander.setpoint.word == HOVER
    assert rig.sim.truth().body_rate[0] == pytest.approx(0.8, abs=0.3)


def test_landing_takes_over_from_rate_set_points_without_stopping_the_motors():
    rig = Rig()
    rig.take_off(1.5)
    rig.run(300, lambda: rig.send(commands.rates(Rates((0.0, 0.0, 0.0), HOVER))), 10)
    rig.send(commands.vertical(Vertical(True, 0.0, None, 3.0)))
    rig.send(commands.relax())
    lowest = []
    rig.run(1000, lambda: lowest.append(min(rig.sim.truth().motors)), 2)
    assert min(lowest) > 0.2
    rig.run(3500)
    assert rig.sim.truth().position[2] == pytest.approx(0.0, abs=0.02)


def test_stop_set_point_stops_the_motors_at_once():
    rig = Rig()
    rig.take_off()
    rig.send(commands.stop())
    rig.run(250)
    assert max(rig.sim.truth().motors) < 0.05


def test_estimate_drifts_without_external_poses_and_is_held_by_them():
    held, blind = Rig(), Rig()
    for rig in (held, blind):
        rig.take_off(1.0)
    blind.blind = True
    for rig in (held, blind):
        rig.run(6000)
    errors = [math.dist(rig.flight.position, rig.sim.truth().position) for rig in (held, blind)]
    assert errors[0] < 0.05 < errors[1]
    assert held.flight.estimator.variance < 1e-3 < blind.flight.estimator.variance


def test_external_pose_that_is_not_finite_is_refused():
    rig = Rig()
    rig.run(100)
    rig.send(commands.external_pose((math.nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
    rig.run(10)
    assert rig.flight.estimator.refused == 1
    assert all(map(math.isfinite, rig.flight.position))


def test_battery_sags_under_load_and_an_empty_one_cannot_hold_the_vehicle():
    rig = Rig()
    rest = rig.flight.battery.voltage
    rig.take_off()
    assert rig.flight.battery.voltage < rest - 0.1
    rig.flight.battery.charge = 0.0
    full = Rates((0.0, 0.0, 0.0), 65535)
    rig.run(500, lambda: rig.send(commands.rates(full)), 10)
    assert rig.flight.battery.state == 3


def test_equal_seeds_and_bytes_give_equal_bytes_and_states():
    def flown():
        rig = Rig()
        rig.log(["stateEstimate.x", "stateEstimate.z", "pm.vbat"])
        rig.take_off()
        return rig.received, rig.flight.row.tobytes()

    assert flown() == flown()


def test_it_rides_on_what_holds_it():
    rig = Rig()
    rig.take_off()
    for at in range(100):
        rig.sim.attach((0.01 * at, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), rig.now)
        rig.run(10)
    assert rig.flight.row[state_row.V] == pytest.approx(1.0, abs=0.05)
    assert rig.sim.truth().attached


@pytest.mark.parametrize("position", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0)])
def test_start_that_is_not_finite_is_refused(position):
    with pytest.raises(ValueError, match="must be finite"):
        CrazyflieSim(None, load_airframe("crazyflie"), position=position)


def test_airframe_that_its_motors_cannot_lift_is_refused():
    with pytest.raises(ValueError, match=r"a Crazyflie's motors lift 0\.048 kg"):
        CrazyflieSim(None, load_airframe("paper_quad"))
