"""The software Crazyflie's supervisor: arming, watchdogs, tumble check, emergency stop, as the firmware's."""

import math

import pytest

from tests.unit.vehicle.crazyflie.sim.client import Rig
from vehicle.crazyflie import commands
from vehicle.crazyflie.commands import Rates, Vertical
from vehicle.crazyflie.crtp import Packet, Port, SupervisorChannel, SupervisorCommand
from vehicle.crazyflie.sim.supervisor import State
from vehicle.quadrotor import state_row

HOVER = Rates((0.0, 0.0, 0.0), 41650)


def test_it_is_armed_only_by_request_and_then_ready_to_fly():
    rig = Rig()
    rig.run(300)
    assert rig.state == State.READY_TO_ARM
    arm = Packet(Port.SUPERVISOR, SupervisorChannel.COMMAND, bytes((SupervisorCommand.ARM, 1)))
    assert rig.ask(arm) == [bytes((0x80 | SupervisorCommand.ARM, 1, 1))]
    rig.run(200)
    assert rig.state == State.READY_TO_FLY
    assert rig.bits() >= {"ARMED", "CAN_FLY"}


def test_a_build_that_arms_itself_needs_no_request():
    rig = Rig(auto_arm=True)
    rig.run(300)
    assert rig.state == State.READY_TO_FLY
    assert rig.bits() >= {"ARMED", "AUTO_ARMED", "CAN_FLY"}
    assert not rig.sim.truth().armed


def test_set_points_do_nothing_before_it_is_armed():
    rig = Rig()
    rig.run(500, lambda: rig.send(commands.rates(HOVER)))
    assert max(rig.sim.truth().motors) == 0.0


def test_it_disarms_by_itself_if_it_does_not_take_off():
    rig = Rig()
    rig.arm()
    rig.flight.supervisor.preflight_timeout_ns = 1_000_000_000
    rig.run(1500)
    assert rig.state == State.READY_TO_ARM
    assert not rig.sim.truth().armed


def test_missing_set_points_level_it_after_500_ms_and_stop_its_motors_after_2_s():
    rig = Rig()
    rig.take_off(2.0)
    rig.run(300, lambda: rig.send(commands.rates(HOVER)))
    tilt = Rates((1.0, 0.0, 0.0), HOVER.word)
    rig.run(300, lambda: rig.send(commands.rates(tilt)))
    rig.run(440)
    assert rig.state == State.FLYING
    rig.run(120)
    assert rig.state == State.LEVEL_OUT
    rig.run(700)
    assert abs(math.degrees(2.0 * math.asin(rig.flight.row[state_row.Q + 1]))) < 5.0
    assert max(rig.sim.truth().motors) > 0.3
    rig.run(700)
    rig.run(120)
    assert rig.state == State.LOCKED
    assert "Locked, reboot required" in rig.texts()
    rig.run(300)
    assert max(rig.sim.truth().motors) < 0.05
    assert not rig.sim.truth().armed


def test_a_set_point_within_2_s_brings_it_back():
    rig = Rig()
    rig.take_off(2.0)
    rig.run(100, lambda: rig.send(commands.rates(HOVER)))
    rig.run(700)
    assert rig.state == State.LEVEL_OUT
    rig.run(100, lambda: rig.send(commands.rates(HOVER)))
    assert rig.state == State.FLYING


@pytest.mark.parametrize(
    "stop",
    [
        commands.supervisor(SupervisorCommand.EMERGENCY_STOP),
        Packet(Port.LOCALIZATION, 1, bytes((commands.OLD_EMERGENCY_STOP,))),
    ],
    ids=["supervisor", "localization"],
)
def test_emergency_stop_locks_it(stop):
    rig = Rig()
    rig.take_off()
    rig.send(stop)
    rig.run(100)
    assert rig.state == State.LOCKED
    rig.send(commands.supervisor(SupervisorCommand.ARM, 1))
    rig.run(200)
    assert not rig.flight.supervisor.armed


def test_emergency_watchdog_stops_it_a_second_after_it_was_last_fed():
    rig = Rig()
    rig.take_off()
    rig.run(1500, lambda: rig.send(commands.supervisor(SupervisorCommand.EMERGENCY_STOP_WATCHDOG)))
    assert rig.state == State.FLYING
    rig.run(1100)
    assert rig.state == State.LOCKED


def test_disarming_in_flight_stops_the_motors():
    rig = Rig()
    rig.take_off()
    rig.send(commands.supervisor(SupervisorCommand.ARM, 0))
    rig.run(100)
    assert not rig.flight.supervisor.can_fly
    rig.run(400)
    assert max(rig.sim.truth().motors) < 0.05


def test_hanging_on_a_wall_is_a_crash_after_a_second_and_recovers_upright_only():
    rig = Rig()
    rig.take_off()
    half = math.sqrt(0.5)
    truth = rig.sim.truth()
    rig.flight.row[state_row.Q : state_row.Q + 4] = (half, 0.0, half, 0.0)
    rig.run(900, lambda: rig.sim.attach(truth.position, (1.0, 0.0, 0.0, 0.0), rig.now))
    assert rig.state == State.FLYING
    rig.run(300, lambda: rig.sim.attach(truth.position, (1.0, 0.0, 0.0, 0.0), rig.now))
    assert rig.state == State.CRASHED
    recover = Packet(Port.SUPERVISOR, SupervisorChannel.COMMAND, bytes((SupervisorCommand.RECOVER,)))
    assert rig.ask(recover) == [bytes((0x80 | SupervisorCommand.RECOVER, 0, 0))]


def test_landed_it_disarms_after_its_timeouts():
    rig = Rig()
    rig.take_off()
    rig.send(commands.vertical(Vertical(True, 0.0, None, 2.0)))
    rig.run(2500)
    rig.run(2500)
    assert rig.state == State.LANDED
    rig.run(3500)
    assert rig.state == State.READY_TO_ARM
    assert not rig.flight.supervisor.armed
