import math
from collections import Counter

import numpy as np
import pytest

from groundcar.scout.codec import Decoder, Frame, encode, feedback_names
from groundcar.scout.params import load_scout
from groundcar.scout.sim import ScoutSim

MS = 1_000_000
ENABLE = encode("ControlMode", {"mode": 1})


class Bench:
    """A car on a bench: commands every 20 ms, every frame it sends decoded."""

    def __init__(self, bus, seed=0, **options):
        self.bus, self.car_end = bus
        self.car, self.now, self.reported = ScoutSim(self.car_end, seed=seed, **options), 0, {}
        self.frames = Counter()
        self.decoder = Decoder(feedback_names())
        self.speeds = []

    def run(self, seconds, speed=None, turn=0.0):
        for _ in range(round(seconds * 250)):
            if speed is not None and self.now % (20 * MS) == 0:
                self.bus.send(encode("MotionCommand", {"speed": speed, "turn_rate": turn}))
            self.car.step(self.now)
            for frame in self.bus.receive():
                self.frames[frame[0]] += 1
                name, values = self.decoder.decode(frame)
                self.reported[name] = values
            self.speeds.append(self.car.speed)
            self.now += 4 * MS
        return self

    def enable(self):
        self.bus.send(ENABLE)
        return self


@pytest.fixture
def bench(bus):
    return Bench(bus)


def test_power_on_is_standby_where_only_the_mode_is_obeyed(bench):
    bench.run(1.0, speed=1.0)
    assert bench.reported["SystemState"]["mode"] == 0
    assert bench.car.speed == 0.0
    assert bench.car.ignored_commands == 50
    bench.enable().run(1.5, speed=1.0)
    assert bench.reported["SystemState"]["mode"] == 1
    assert bench.car.speed == pytest.approx(1.0, abs=0.15)


def test_mode_frame_is_accepted_in_the_forms_of_sdk_and_manual(bench):
    bench.bus.send((0x421, b"\x01"))
    bench.run(0.2)
    assert bench.reported["SystemState"]["mode"] == 1
    bench.bus.send((0x421, b"\x07"))  # no such mode
    assert bench.run(0.2).reported["SystemState"]["mode"] == 1


def test_half_a_second_without_commands_stops_the_car(bench):
    bench.enable().run(2.0, speed=1.5)
    driving = bench.car.speed
    bench.run(0.48)  # the last command came 16 ms before
    assert bench.car.speed > 0.95 * driving
    bench.run(0.3)
    assert bench.car.speed < 0.7 * driving
    bench.run(1.7)
    assert bench.car.speed == pytest.approx(0.0, abs=0.01)
    assert bench.reported["SystemState"]["mode"] == 1


def test_invalid_and_foreign_frames_do_not_move_the_car(bench):
    bench.enable().run(0.1)
    for frame in [
        (0x111, b"\x05\xdc\x00"),
        (0x7FF, bytes(8)),
        (0x221, bytes(8)),
        (0x111, b""),
        (0x421, b"\x01\x00\x00"),
    ]:
        bench.bus.send(frame)
    bench.run(1.0)
    assert bench.car.rejected_frames == 5
    assert bench.car.speed == 0.0


def test_feedback_is_sent_at_the_cycles_of_the_manual(bench):
    bench.run(2.0)
    for can_id in (0x221, 0x311, 0x231, 0x241, 0x251, 0x252, 0x253, 0x254, 0x261, 0x262, 0x263, 0x264):
        assert bench.frames[can_id] == 100
    assert bench.frames[0x211] == bench.frames[0x361] == 20
    assert bench.decoder.rejected == 0


def test_late_step_of_the_host_causes_no_burst_of_feedback(bus):
    car = ScoutSim(bus[1])
    for now in (0, 500 * MS, 505 * MS, 520 * MS):
        car.step(now)
    assert sum(frame[0] == 0x221 for frame in bus[0].receive()) == 3


def test_estop_stops_at_once_and_is_reported(bench):
    bench.enable().run(2.0, speed=2.0)
    bench.car.press_estop()
    bench.run(0.7, speed=2.0)
    assert bench.reported["SystemState"]["state"] == 1
    assert bench.car.speed == pytest.approx(0.0, abs=1e-9)
    bench.car.press_estop(False)
    bench.run(2.0, speed=1.0)
    assert bench.reported["SystemState"]["state"] == 0
    assert bench.car.speed == pytest.approx(1.0, abs=0.15)


def test_a_fault_is_latched_until_cleared(bench):
    bench.enable().run(1.0, speed=1.0)
    bench.car.inject("driver_hot", 3)
    bench.run(1.0, speed=1.0)
    assert bench.reported["SystemState"]["state"] == 2
    assert bench.reported["Driver3"]["driver_hot"] == 1
    assert bench.reported["Driver2"]["driver_hot"] == 0
    assert bench.car.speed == pytest.approx(0.0, abs=1e-9)
    bench.bus.send(encode("ClearErrors", {"motor": 2}))
    assert bench.run(0.2).reported["SystemState"]["state"] == 2
    bench.bus.send(encode("ClearErrors", {"motor": 3}))
    assert bench.run(0.2).reported["SystemState"]["state"] == 0


def test_lasting_fault_can_be_cleared_only_after_its_cause_ended(bench):
    bench.enable().run(0.1)
    bench.car.inject("motor_hot", 1, lasting=True)
    bench.bus.send(encode("ClearErrors", {}))
    assert bench.run(0.2).reported["SystemState"]["state"] == 2
    bench.car.heal("motor_hot", 1)
    bench.bus.send(encode("ClearErrors", {}))
    assert bench.run(0.2).reported["SystemState"]["state"] == 0
    with pytest.raises(ValueError, match="motor_hot"):
        bench.car.inject("flat tyre")


def test_the_remote_control_has_priority_and_gives_back_to_standby(bench):
    bench.enable().run(1.0, speed=1.0)
    bench.car.set_rc((-0.5, 0.0))
    bench.run(2.5, speed=1.0)
    assert bench.reported["SystemState"]["mode"] == 3
    assert bench.car.speed == pytest.approx(-0.5, abs=0.15)
    bench.enable().run(0.2)
    assert bench.reported["SystemState"]["mode"] == 3
    bench.car.set_rc(None)
    bench.run(1.5, speed=1.0)
    assert bench.reported["SystemState"]["mode"] == 0
    assert bench.car.speed == pytest.approx(0.0, abs=0.01)


def test_battery_warns_then_stops_the_car(bench):
    bench.enable().run(1.0, speed=1.0)
    bench.car.battery.set_voltage(23.2)
    bench.run(1.0, speed=1.0)
    assert bench.reported["SystemState"]["under_voltage_warning"] == 1
    assert bench.reported["SystemState"]["state"] == 0
    assert bench.car.speed > 0.8
    bench.car.battery.set_voltage(21.5)
    bench.run(1.0, speed=1.0)
    assert bench.reported["SystemState"]["under_voltage"] == 1
    assert bench.reported["SystemState"]["state"] == 2
    assert bench.car.speed == pytest.approx(0.0, abs=1e-9)


def test_driving_empties_the_battery(bench):
    before = bench.enable().run(0.1).car.battery.charge
    bench.run(5.0, speed=2.0)
    used = before - bench.car.battery.charge
    assert 1.2 * 5 < used * 3600 * 15.0 < 30 * 5  # more than idling, less than 30 A


def test_car_obeys_brake_and_mute_frames(bench):
    bench.enable().run(1.0, speed=1.0)
    bench.bus.send(encode("BrakeCommand", {"lock": 1}))
    bench.run(1.0, speed=1.0)
    assert bench.car.speed == pytest.approx(0.0, abs=1e-9)
    bench.bus.send(encode("BrakeCommand", {"lock": 0}))
    assert bench.run(1.5, speed=1.0).car.speed > 0.8
    bench.car.mute("MotionState")
    received = bench.frames[0x221]
    bench.run(0.5)
    assert bench.frames[0x221] == received
    assert bench.frames[0x311] > received


def test_lights_are_reported(bench):
    bench.enable().run(0.1)
    bench.bus.send(encode("LightCommand", {"enable": 1, "front_mode": 3, "front": 40}))
    assert bench.run(0.1).reported["LightState"]["front"] == 40


def test_wheels_and_truth_differ_as_a_skid_steered_car_s_do(bus):
    reported, true, veer = [], [], []
    for seed in range(8):
        bench = Bench(bus, seed)
        bench.enable().run(1.0, speed=1.0, turn=0.8)
        turned = [
            (bench.run(0.02, 1.0, 0.8).reported["MotionState"]["turn_rate"], bench.car.turn_rate) for _ in range(100)
        ]
        reported.append(np.mean(turned, axis=0)[0])
        true.append(np.mean(turned, axis=0)[1])
        start = bench.car.pose.heading
        bench.run(3.0, speed=1.0)
        veer.append(bench.car.pose.heading - start)
    assert np.mean(reported) == pytest.approx(0.8, abs=0.02)
    assert 0.85 < np.mean(true) / np.mean(reported) < 0.99
    assert np.std(np.array(true) / reported) > 0.005


def test_odometry_adds_up_the_wheels(bench):
    bench.enable().run(0.1)
    bench.run(3.0, speed=1.0)
    rolled = bench.reported["Odometry"]
    distance = math.hypot(*bench.car.pose[:2])
    assert 0.5 * (rolled["left"] + rolled["right"]) == pytest.approx(distance, rel=0.06)
    assert bench.reported["Motor1"]["pulses"] == pytest.approx(rolled["right"] * 10_000, abs=400)
    assert bench.reported["Motor1"]["rpm"] > 90


def test_parked_car_does_not_move(bench):
    bench.enable().run(3.0, speed=0.0)
    assert bench.car.pose == (0.0, 0.0, 0.0)


def test_equal_seeds_give_equal_cars_whatever_the_host_s_period(bus):
    def drive(seed, period):
        bus[0].receive()
        car = ScoutSim(bus[1], seed=seed)
        for now in range(0, 2000 * MS + 1, period):
            if now % (20 * MS) == 0:
                bus[0].send(ENABLE)
                bus[0].send(encode("MotionCommand", {"speed": 1.5, "turn_rate": 0.3}))
            car.step(now)
        bus[0].receive()
        return [*car.pose, car.speed, car.turn_rate]

    assert drive(1, 4 * MS) == drive(1, 4 * MS)
    assert drive(1, 4 * MS) == drive(1, 2 * MS)
    assert drive(1, 4 * MS) != drive(2, 4 * MS)


def test_board_row_has_the_pose_and_motion_of_the_car(bench):
    bench.enable().run(2.0, speed=1.0, turn=0.4)
    row = bench.car.board_row(1.5, 1.2)
    assert list(row) == [
        *bench.car.pose[:2],
        1.5,
        bench.car.pose.heading,
        bench.car.speed,
        bench.car.turn_rate,
        1.2,
        0.0,
    ]


def test_protocol_1_car_sends_only_the_v1_state(bus):
    car = ScoutSim(bus[1], protocol=1)
    bus[0].send(ENABLE)
    for k in range(100):
        car.step(k * 4 * MS)
    assert {frame[0] for frame in bus[0].receive()} == {0x151}
    assert car.mode == 0


def test_invalid_arguments_are_refused(bus):
    with pytest.raises(ValueError, match="protocol"):
        ScoutSim(bus[1], protocol=3)
    with pytest.raises(ValueError, match="finite"):
        ScoutSim(bus[1], pose=(math.nan, 0.0, 0.0))
    car = ScoutSim(bus[1], load_scout())
    car.step(100 * MS)
    with pytest.raises(ValueError, match="backward"):
        car.step(50 * MS)
    assert isinstance(bus[0].receive()[0], Frame)
