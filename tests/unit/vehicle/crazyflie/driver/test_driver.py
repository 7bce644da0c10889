"""The Crazyflie driver on the software Crazyflie: from the first packet to body rates and back, and its troubles."""

import math
import re
import struct

import pytest

from tests.unit.vehicle.crazyflie.driver.bench import HOVER, START, Bench
from vehicle.crazyflie.crtp import Packet, Port
from vehicle.crazyflie.driver.device import STATE_BLOCK, Device
from vehicle.crazyflie.driver.table_reader import TableReader
from vehicle.crazyflie.driver.types import CrazyflieConfig
from vehicle.crazyflie.sim.supervisor import State
from vehicle.crazyflie.table import LOG_KINDS, Contents, Variable
from vehicle.crazyflie.thrust import available_force, word_of
from vehicle.px4.driver.arming import Arming, Identity
from vehicle.px4.driver.types import Rates
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import GRAVITY


@pytest.mark.parametrize("auto_arm", [False, True])
def test_it_hovers_at_the_start_whether_or_not_it_arms_itself(auto_arm):
    bench = Bench(auto_arm=auto_arm).until("hover")
    truth = bench.sim.truth()
    assert math.dist(truth.position, START[:3]) < 0.15
    assert bench.output.armed
    assert bench.output.hover_thrust == pytest.approx(0.635, abs=0.02)
    assert bench.link.parameters["stabilizer.estimator"] == 2.0
    assert bench.link.identity == Identity("", "2026.08")


def test_thrust_is_what_was_asked_for_with_a_heavier_vehicle():
    frame_row = Bench().sim._params.copy()
    frame_row[0] *= 1.15
    bench = Bench(params_row=frame_row).until("hover")
    bench.run(400, HOVER)
    before = bench.sim.truth().velocity[2]
    bench.run(300, Rates((0.0, 0.0, 0.0), GRAVITY + 1.0))
    assert (bench.sim.truth().velocity[2] - before) / 0.3 == pytest.approx(1.0, abs=0.35)


def test_thrust_beyond_the_battery_is_bounded_by_it():
    bench = Bench(charge=0.3).until("hover")
    bench.sim.flight.battery.charge = 0.0
    bench.run(400, Rates((0.0, 0.0, 0.0), 14.9))
    bench.run(10, Rates((0.0, 0.0, 0.0), 14.9))
    most = word_of(available_force(bench.link._device.status.battery_v)) / 65535
    sent = [struct.unpack_from("<H", d, 14)[0] for d in bench.wire.sent if d[0] >> 4 == Port.SETPOINT_GENERIC]
    assert sent[-1] / 65535 == pytest.approx(most, abs=0.02)


def test_missing_commands_make_it_land():
    bench = Bench().until("hover")
    bench.run(300, HOVER)
    bench.run(400)
    assert bench.phase == "released"
    assert any(text.startswith("control lost: no command for 0.25 s; it lands") for text in bench.texts())
    bench.run(7000)
    assert not bench.output.armed
    assert bench.sim.flight.supervisor.state not in (State.LOCKED, State.CRASHED)


def test_lost_radio_is_told_and_the_firmware_stops_the_motors():
    bench = Bench().until("hover")
    bench.run(300, HOVER)
    bench.wire.stopped = bench.wire.deaf = True
    bench.run(2700, HOVER)
    assert bench.sim.flight.supervisor.state == State.LOCKED
    assert not bench.output.connected
    assert "link lost: no log data for 1 s" in bench.texts()


def test_lost_motion_capture_lets_the_estimate_drift_and_its_variance_tells():
    bench = Bench().until("hover")
    bench.poses = False
    bench.run(4000)
    assert bench.link._device.status.variance > 1e-2
    assert bench.texts().count("it no longer knows where it is: no external pose comes") == 1


def test_low_battery_is_told_once():
    bench = Bench().until("hover")
    bench.sim.flight.battery.charge = 0.05
    bench.run(1000)
    assert len([text for text in bench.texts() if text.startswith("its battery is low: 3.")]) == 1


def test_battery_that_stays_low_makes_it_land_and_one_that_recovers_does_not():
    bench = Bench().until("hover")
    for charge, ms in ((0.05, 1200), (1.0, 500), (0.05, 1200)):
        bench.sim.flight.battery.charge = charge
        bench.run(ms, HOVER)
    assert bench.phase == "handed_over"
    bench.run(500, HOVER)
    assert bench.phase == "released" and "its battery is low for 1.5 s; it lands" in bench.texts()
    bench.run(8000)
    assert not bench.output.armed
    assert bench.sim.flight.supervisor.state not in (State.LOCKED, State.CRASHED)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"protocol_version": 11}, "speaks CRTP version 11, this driver 12"),
        ({"charge": 0.0}, r"its battery has 3\.30 V, 3\.6 V are needed"),
    ],
)
def test_it_is_not_armed_with_another_protocol_or_an_empty_battery(options, why):
    bench = Bench({"ready_limit": 2.0, "least_battery": 3.6}, **options).until("failed")
    assert not bench.sim.truth().armed
    assert re.search(why, " ".join(bench.texts()))


def test_it_is_not_armed_without_poses():
    bench = Bench({"ready_limit": 2.0})
    bench.poses = False
    bench.until("failed")
    assert "it does not know where it is: no external pose reaches its estimator" in bench.texts()[-1]


def test_it_is_not_armed_while_it_lies_on_its_side():
    bench = Bench({"ready_limit": 2.0})
    half = math.sqrt(0.5)
    bench.sim.flight.row[state_row.Q : state_row.Q + 4] = (half, half, 0.0, 0.0)
    truth = bench.sim.truth()
    bench.sim.attach(truth.position, (1.0, 0.0, 0.0, 0.0), 0)
    for _ in range(600):
        bench.now += 2_000_000
        bench.sim.step(bench.now)
    bench.until("failed")
    assert "it is not upright" in bench.texts()[-1]


def test_permission_to_arm_is_awaited_and_its_conditions_are_compared():
    bench = Bench({"arm": False}).until("ready")
    bench.run(1000)
    assert bench.phase == "ready"
    bench.link.allow_arming(Arming(Identity("", "2026.08"), {"supervisor.tmblChckEn": 0.0}))
    bench.until("failed")
    assert "not armed, this is not as it was checked: supervisor.tmblChckEn is 1, checked was 0" in bench.texts()
    other = Bench({"arm": False}).until("ready")
    other.link.allow_arming(Arming(Identity("", "2026.08"), {"supervisor.tmblChckEn": 1.0}))
    other.until("takeoff")


def test_silent_crazyflie_is_told():
    bench = Bench()
    bench.wire.deaf = True
    bench.run(11000)
    assert bench.phase == "connect"
    assert any("no Crazyflie answers yet" in text for text in bench.texts())


def test_table_that_changes_while_it_is_read_is_refused():
    tables = [Contents([Variable("a", name, "uint8")], LOG_KINDS) for name in "bc"]
    reader = TableReader(Port.LOG, LOG_KINDS)
    for now, table in enumerate((tables[0], tables[0], tables[1])):
        for request in reader.requests(now * 10**9):
            reader.receive(table.answer(request.data, (16, 128)))
    assert reader.fault.startswith("its length and CRC changed from 1 and")


def test_table_is_read_though_packets_are_lost():
    table = Contents([Variable("group", f"v{i}", "float") for i in range(30)], LOG_KINDS)
    reader, lost = TableReader(Port.LOG, LOG_KINDS), 0
    for now in range(2000):
        for request in reader.requests(now * 50_000_000):
            lost += 1
            if lost % 3:
                reader.receive(table.answer(request.data, (16, 128)))
        if reader.done:
            break
    assert reader.done
    assert set(reader.numbers) == set(table.numbers)


def test_time_of_the_device_may_wrap_and_a_restart_is_told():
    device = Device(0.0, 1e-4)
    body = struct.pack("<6h4e3h", *[0] * 6, 1.0, 0.0, 0.0, 0.0, 0, 0, 0)

    def hear(ms, now_ms):
        device.begin()
        device.data(bytes((STATE_BLOCK,)) + ms.to_bytes(3, "little") + body, now_ms * 1_000_000)

    hear((1 << 24) - 5, 1000)
    hear(5, 1010)
    assert not device.rebooted
    assert device.odometry.stamp_ns == 1010 * 1_000_000
    hear(2_000_000, 2_001_005)
    hear(20, 2_001_100)
    assert device.rebooted


@pytest.mark.parametrize(
    "wrong",
    [{"mass": 0.6}, {"mass": 0.0}, {"gap_limit": 0.0}, {"least_battery": 2.0}, {"start": (math.nan, 0.0, 1.0, 0.0)}],
)
def test_configuration_out_of_range_is_refused(wrong):
    with pytest.raises(ValueError, match=r"must be|lift|between"):
        CrazyflieConfig(**{"start": START, "mass": 0.0311, **wrong})


def test_foreign_bytes_are_counted():
    bench = Bench()
    bench.sim._wire.send(b"")
    bench.sim._wire.send(bytes(40))
    bench.sim._send(Packet(Port.LOG, 2, b"\x07abc"))
    bench.run(10)
    assert bench.link.garbage == 3
