"""The simulated vehicle behind PX4's simulator interface, with a firmware that is a few lines of the test."""

import math
from collections import deque

import numpy as np
import pytest

from vehicle.px4.codec import Packer, Parser
from vehicle.px4.hitl.device import BASE_US, FirmwareFault, HitlVehicle
from vehicle.px4.hitl.sensors import QUIET
from vehicle.quadrotor import airframe_row
from vehicle.quadrotor.airframe import load_airframe

TICK = 4_000_000
FRAME = load_airframe("paper_quad")
HOVER = FRAME.hover_thrust


class Firmware:
    """The other end of the wire: answers each HIL_SENSOR with `motors`; keeps what it received."""

    def __init__(self, lockstep=True, motors=(0.0,) * 4, armed=True, flags=1):
        self.lockstep, self.motors, self.armed, self.flags = lockstep, motors, armed, flags
        self.log, self.parser, self.packer, self.waiting = [], Parser(), Packer(1, 1), deque()
        self.mute, self.starts, self.answered = False, 1, False

    def mark_answered(self, answered):
        self.answered = answered

    def restart(self):
        self.starts += 1

    def send(self, data):
        for frame in self.parser.feed(data):
            self.log.append((frame.name, frame.fields))
            if frame.name == "HIL_SENSOR" and not self.mute:
                self.answer(frame.fields.time_usec)

    def answer(self, time_us):
        values = (*self.motors, *(0.0,) * 12)
        self.say("HIL_ACTUATOR_CONTROLS", time_us, values, 129 if self.armed else 1, self.flags)

    def say(self, name, *values):
        self.waiting.append(self.packer.send_name(name, *values))

    def heartbeat(self, base_mode):
        self.say("HEARTBEAT", 2, 12, base_mode, 0, 3, 3)

    def status(self, millivolts):
        self.say("SYS_STATUS", 0, 0, 0, 0, millivolts, 100, 80, *(0,) * 9)

    def receive(self):
        items, self.waiting = list(self.waiting), deque()
        return items

    def of(self, name):
        return [fields for kind, fields in self.log if kind == name]


def vehicle(firmware, **options):
    return HitlVehicle(firmware, FRAME, noise=QUIET, **options)


def fly(body, seconds, from_s=0.0):
    for i in range(round(from_s * 250), round((from_s + seconds) * 250) + 1):
        body.step(i * TICK)


def test_sensors_come_at_their_own_rates_on_the_hosts_clock():
    firmware = Firmware()
    fly(vehicle(firmware), 1.0)
    sensors = firmware.of("HIL_SENSOR")
    assert [s.time_usec for s in sensors[:3]] == [BASE_US, BASE_US + 4000, BASE_US + 8000]
    assert len(sensors) == 251
    assert all(s.id == 0 and s.fields_updated & 0b111111 == 0b111111 for s in sensors)
    assert sum(bool(s.fields_updated & 0b111000000) for s in sensors) == 51
    assert sum(s.fields_updated & 0b1101000000000 == 0b1101000000000 for s in sensors) == 51
    fixes = firmware.of("HIL_GPS")
    assert len(fixes) == 9, "the first one comes after the receiver's delay"
    assert (fixes[0].fix_type, fixes[0].lat, fixes[0].lon, fixes[0].alt) == (3, 473977422, 85455941, 489400)


def test_fix_is_as_old_as_the_estimator_takes_it_to_be():
    """EKF2_GPS_DELAY is 110 ms by default, and PX4 stamps a fix with its clock of the tick before."""
    firmware = Firmware(motors=(1.3 * HOVER,) * 4)
    body, climb = vehicle(firmware), []
    for i in range(251):
        body.step(i * TICK)
        climb.append(body.truth().position[2])
    sent = next(i for i, (name, _) in enumerate(firmware.log) if name == "HIL_GPS")
    assert sum(name == "HIL_SENSOR" for name, _ in firmware.log[:sent]) == 28
    last = firmware.of("HIL_GPS")[-1]
    assert last.alt == pytest.approx(489400 + 1000 * climb[200], abs=1)
    assert climb[228] - climb[200] > 0.2


def test_without_gps_none_is_sent():
    firmware = Firmware()
    fly(vehicle(firmware, gps=False), 1.0)
    assert not firmware.of("HIL_GPS")


def test_disarmed_vehicle_stands_on_the_ground():
    firmware = Firmware(motors=(1.0,) * 4, armed=False)
    body = vehicle(firmware, position=(1.0, 2.0, 0.0), yaw=0.5)
    fly(body, 0.5)
    truth = body.truth()
    assert truth.position == (1.0, 2.0, 0.0) and truth.velocity == (0.0, 0.0, 0.0) and not truth.armed
    assert firmware.of("HIL_SENSOR")[-1].zacc == pytest.approx(-9.80665, abs=1e-5)


def test_hover_thrust_of_the_firmware_carries_the_vehicle():
    firmware = Firmware(motors=(1.1 * HOVER,) * 4)
    body = vehicle(firmware)
    fly(body, 1.0)
    rising = body.truth().velocity[2]
    assert 0.7 < rising < 0.1 * 9.80665, "less drag and the motors' lag"
    assert firmware.of("HIL_SENSOR")[-1].zacc == pytest.approx(-1.1 * 9.80665 + 0.26 * rising, rel=0.01)
    assert firmware.of("HIL_GPS")[-1].vd < -50


@pytest.mark.parametrize(
    ("stronger", "axis", "sign"),
    [((1, 2), 0, 1), ((0, 3), 0, -1), ((0, 2), 1, 1), ((1, 3), 1, -1), ((0, 1), 2, 1), ((2, 3), 2, -1)],
)
def test_motors_turn_the_vehicle_as_px4s_quad_x_does(stronger, axis, sign):
    """0 front right, 1 rear left, 2 front left, 3 rear right; roll right, pitch up and yaw right are positive."""
    motors = [HOVER * (1.3 if i in stronger else 1.2) for i in range(4)]
    firmware = Firmware(motors=tuple(motors))
    fly(vehicle(firmware), 0.4)
    last = firmware.of("HIL_SENSOR")[-1]
    rates = np.array([last.xgyro, last.ygyro, last.zgyro])
    assert np.argmax(np.abs(rates)) == axis and math.copysign(1, rates[axis]) == sign


def test_equal_seeds_give_equal_bytes():
    logs = []
    for _ in range(2):
        firmware = Firmware(motors=(1.2 * HOVER,) * 4)
        fly(HitlVehicle(firmware, FRAME, 5), 0.5)
        logs.append(firmware.log)
    assert logs[0] == logs[1]


def test_drawn_mass_flies_in_place_of_the_airframes():
    row = FRAME.params_row()
    row[airframe_row.MASS] *= 1.3
    body = vehicle(Firmware(motors=(1.1 * HOVER,) * 4), params_row=row)
    fly(body, 0.5)
    assert body.truth().position[2] == 0.0


def test_true_state_is_sent_where_the_firmware_asks_for_it():
    firmware = Firmware(motors=(1.2 * HOVER,) * 4)
    body = vehicle(firmware, position=(1.0, 2.0, 0.0), yaw=math.pi / 2)
    firmware.say("COMMAND_LONG", 0, 0, 511, 0, 115.0, 5e3, 0.0, 0.0, 0.0, 0.0, 0.0)
    fly(body, 0.5)
    states = firmware.of("HIL_STATE_QUATERNION")
    assert len(states) == 25, "50 Hz, whatever more it asks for"
    assert states[-1].attitude_quaternion == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-6)
    assert states[-1].vz == pytest.approx(-100 * body.truth().velocity[2], abs=2)
    assert states[-1].alt == pytest.approx(489400 + 1000 * body.truth().position[2], abs=10)


def test_wind_and_board_act_on_it():
    body = vehicle(Firmware(motors=(1.1 * HOVER,) * 4))
    body.set_wind((5.0, 0.0, 0.0))
    fly(body, 1.0)
    assert body.truth().velocity[0] > 0.3
    for i in range(251, 300):
        body.attach((0.02 * (i - 250), 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), i * TICK)
        body.step(i * TICK)
    assert body.truth().attached
    assert body.truth().velocity[0] == pytest.approx(5.0, abs=0.05)


def test_firmware_that_has_never_answered_is_given_time():
    firmware = Firmware()
    firmware.mute = True
    body = vehicle(firmware)
    fly(body, 2.0)
    assert body.unanswered == 501
    firmware.mute = False
    fly(body, 0.1, 2.0)
    assert body.controls.count > 0


def test_firmware_that_never_answers_is_a_fault():
    firmware = Firmware()
    firmware.mute = True
    with pytest.raises(FirmwareFault, match="never answered"):
        fly(vehicle(firmware), 8.0)


def test_firmware_that_falls_silent_is_a_fault():
    firmware = Firmware()
    body = vehicle(firmware)
    fly(body, 0.2)
    firmware.mute = True
    with pytest.raises(FirmwareFault, match="answers no more"):
        fly(body, 1.0, 0.2)


def test_firmware_without_lockstep_is_refused():
    with pytest.raises(FirmwareFault, match="without lockstep"):
        fly(vehicle(Firmware(flags=0)), 0.1)


def test_flight_controller_gets_sensors_only_in_hitl_mode():
    controller = Firmware(lockstep=False)
    body = vehicle(controller)
    fly(body, 0.1)
    assert not controller.log, "nothing is sent before it has said what it is"
    controller.heartbeat(1 | 32)
    fly(body, 0.1, 0.104)
    assert not controller.log, "nor before its battery is known"
    controller.status(0)
    fly(body, 0.1, 0.204)
    assert controller.of("HIL_SENSOR")
    other = Firmware(lockstep=False)
    other.heartbeat(1)
    with pytest.raises(FirmwareFault, match=r"not in HITL mode.*SYS_HITL"):
        vehicle(other).step(0)
    assert not other.log


@pytest.mark.parametrize("powered", [False, True])
def test_battery_on_a_flight_controller_needs_the_crews_word(powered):
    controller = Firmware(lockstep=False)
    controller.heartbeat(33)
    controller.status(15800)
    body = vehicle(controller, powered=powered)
    if powered:
        fly(body, 0.1)
        assert controller.of("HIL_SENSOR")
    else:
        with pytest.raises(FirmwareFault, match=r"15\.8 V.*powered = true"):
            body.step(0)


def test_controller_in_real_time_is_not_waited_for():
    controller = Firmware(lockstep=False)
    controller.heartbeat(33)
    controller.status(65535)
    body = vehicle(controller)
    controller.mute = True
    fly(body, 0.5)
    assert body.unanswered == 0
    assert len(controller.of("HIL_SENSOR")) == 125


def test_late_steps_are_caught_up_and_a_lasting_lag_is_told():
    firmware = Firmware()
    body = vehicle(firmware)
    body.step(0)
    body.step(5 * TICK)
    assert len(firmware.of("HIL_SENSOR")) == 6
    body.step(2_000_000_000)
    assert len(firmware.of("HIL_SENSOR")) == 31
    assert any("no real time" in text for text in body.take_notes())
