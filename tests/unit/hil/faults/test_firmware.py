"""Faults at our side of a firmware's sensors, battery and power."""

import numpy as np
import pytest

from hil.contract.node import Inbox
from hil.faults.fault import Host
from hil.faults.firmware import BatteryEmpty, EstimatorReset, FirmwareReboot, GpsLoss, SensorStuck
from hil.nodes.vehicle_firmware import FirmwareVehicle
from kernel.random import stream
from tests.unit.vehicle.px4.hitl.test_device import FRAME, HOVER, TICK, Firmware
from vehicle.px4.codec import Packer, Parser
from vehicle.px4.hitl.device import HitlVehicle
from vehicle.px4.hitl.sensors import SensorNoise


class Bench(Host):
    """A node of the rig `px4-firmware`, stepped by hand."""

    def __init__(self):
        self.firmware = Firmware(motors=(1.2 * HOVER,) * 4)
        self._node = FirmwareVehicle(HitlVehicle(self.firmware, FRAME, 1, noise=SensorNoise()))
        self.ticks = 0

    @property
    def node(self):
        return self._node

    def rebuild(self):
        raise AssertionError

    def run(self, ticks):
        self.firmware.log.clear()
        for _ in range(ticks):
            self._node.step(self.ticks * TICK, Inbox(self._node.inputs))
            self.ticks += 1
        return self.firmware.of("HIL_SENSOR")


def make(kind, **parameters):
    return kind(kind.Parameters(**parameters), stream(1))


@pytest.mark.parametrize(
    ("sensor", "field"),
    [("accelerometer", "zacc"), ("gyro", "xgyro"), ("magnetometer", "ymag"), ("barometer", "abs_pressure")],
)
def test_stuck_sensor_repeats_its_last_reading_and_no_other_does(sensor, field):
    bench, fault = Bench(), make(SensorStuck, sensor=sensor)
    last = bench.run(50)[-1]
    fault.begin(bench)
    stuck = bench.run(50)
    for name in ("zacc", "xgyro", "ymag", "abs_pressure"):
        values = {getattr(one, name) for one in stuck}
        assert (values == {getattr(last, name)}) == (name == field), name
    fault.end(bench)
    assert len({getattr(one, field) for one in bench.run(50)}) > 10


def test_stuck_and_lost_gps():
    bench, stuck, lost = Bench(), make(SensorStuck, sensor="gps"), make(GpsLoss)
    bench.run(100)
    before = bench.firmware.of("HIL_GPS")[-1].alt
    stuck.begin(bench)
    bench.run(100)
    assert {fix.alt for fix in bench.firmware.of("HIL_GPS")} == {before}
    stuck.end(bench)
    lost.begin(bench)
    assert bench.run(100) and not bench.firmware.of("HIL_GPS")
    lost.end(bench)
    bench.run(100)
    assert bench.firmware.of("HIL_GPS")[-1].alt > before + 100


def test_offset_of_gps_lasts_as_long_as_the_fault():
    bench, fault = Bench(), make(EstimatorReset, x=8.0)
    bench.run(100)
    longitude = bench.firmware.of("HIL_GPS")[-1].lon
    fault.begin(bench)
    bench.run(100)
    assert bench.firmware.of("HIL_GPS")[-1].lon - longitude == pytest.approx(8.0 / 75400 * 1e7 * 0.999, rel=0.02)
    fault.end(bench)
    bench.run(100)
    assert abs(bench.firmware.of("HIL_GPS")[-1].lon - longitude) < 10


def test_reboot_stops_the_motors_until_the_firmware_answers_again():
    bench = Bench()
    bench.run(250)
    assert bench.firmware.answered and max(bench.node.body.truth().motors) > 0.5 * HOVER
    bench.firmware.mute = True
    make(FirmwareReboot).begin(bench)
    assert (bench.firmware.starts, bench.firmware.answered) == (2, False)
    bench.run(100)
    assert max(bench.node.body.truth().motors) < 1e-3 and not bench.node.body.truth().armed
    bench.firmware.mute = False
    bench.run(100)
    assert bench.firmware.answered and bench.node.body.truth().armed


def test_empty_battery_is_told_once_to_the_autopilot_that_is_flown():
    fault, packer = make(BatteryEmpty), Packer(245, 190)
    heartbeat = packer.send_name("HEARTBEAT", 18, 8, 0, 0, 4, 3)
    command = packer.send_name("COMMAND_LONG", 3, 1, 176, 0, *(0.0,) * 7)
    assert fault.carried(command, False) == [(0, command)]
    assert fault.carried(heartbeat, True) == [(0, heartbeat)]
    (_, first), (_, told) = fault.carried(command, True)
    (frame,) = Parser().feed(told)
    f = frame.fields
    assert first == command
    assert (f.target_system, f.command, f.param1, f.param2) == (3, 420, 100.0, 1.0)
    assert fault.carried(command, True) == [(0, command)]


def test_sensors_are_as_without_faults_before_and_after_them():
    plain, broken = Bench(), Bench()
    fault = make(SensorStuck, sensor="gyro")
    for act in (fault.begin, fault.end):
        for bench in (plain, broken):
            bench.run(50)
        act(broken)
    assert np.array_equal([f[1:14] for f in plain.run(50)], [f[1:14] for f in broken.run(50)])
