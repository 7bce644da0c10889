"""Items of a Crazyflie: a healthy one passes, and each fault is seen by the item meant for it."""

import functools
import math

import pytest

from hil.assembly.rig import load_rig
from hil.bench import crazyflie as bench_crazyflie
from hil.bench.devices import Context
from hil.bench.reading import Unavailable
from hil.check.catalogue import checks
from hil.check.checklist import load_checklist
from hil.wires import WireError, mocap_vrpn
from scenarios.spec import load
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.quadrotor import state_row


def made(folder, rig="crazyflie-sim"):
    return Context(rig, load_rig(rig), "planner-analytic", load("crazyflie-wall"), folder)


def reading(context, name):
    return checks()[name].function(context)


def sim_with(monkeypatch, **changes):
    monkeypatch.setattr(bench_crazyflie, "CrazyflieSim", functools.partial(CrazyflieSim, **changes))


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    return made(tmp_path_factory.mktemp("out"))


def limits_of(name):
    items = [item for group in load_checklist("crazyflie").group for item in group.item]
    return next(item.limits for item in items if item.check == name)


def test_healthy_crazyflie_is_within_the_limits_of_its_list(healthy):
    assert reading(healthy, "crazyflie.firmware").value == "2026.08"
    assert reading(healthy, "crazyflie.upright").ok
    assert reading(healthy, "crazyflie.battery").value > limits_of("crazyflie.battery").marginal_min
    assert reading(healthy, "crazyflie.odometry").value > limits_of("crazyflie.odometry").marginal_min
    assert reading(healthy, "crazyflie.pose").value < limits_of("crazyflie.pose").marginal_max


def test_trial_flight_measures_the_battery_under_load_and_the_firmware_s_watchdog(healthy):
    load_v, rest_v = (reading(healthy, f"crazyflie.{name}").value for name in ("battery_load", "battery"))
    assert limits_of("crazyflie.battery_load").marginal_min < load_v < rest_v - 0.1
    loss = reading(healthy, "crazyflie.radio_loss")
    assert 2.0 < loss.value < limits_of("crazyflie.radio_loss").max
    assert "flew level after 0.5" in loss.detail


def test_crazyflie_on_its_side_is_seen(tmp_path, monkeypatch):
    context = made(tmp_path)
    bench = context._crazyflie_bench()
    half = math.sqrt(0.5)
    bench.sim.flight.row[state_row.Q : state_row.Q + 4] = (half, half, 0.0, 0.0)
    bench.sim.attach((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 0)
    monkeypatch.setattr(context, "_crazyflie_bench", lambda: bench)
    found = reading(context, "crazyflie.upright")
    assert not found.ok
    assert found.detail == "tumbled"


def test_empty_battery_and_another_protocol_are_seen(tmp_path, monkeypatch):
    sim_with(monkeypatch, charge=0.1)
    assert reading(made(tmp_path), "crazyflie.battery").value < limits_of("crazyflie.battery").min
    sim_with(monkeypatch, protocol_version=11)
    with pytest.raises(Unavailable, match="speaks CRTP version 11"):
        reading(made(tmp_path), "crazyflie.firmware")


def test_px4_s_items_do_not_read_a_crazyflie_and_the_other_way_round(tmp_path, healthy):
    with pytest.raises(Unavailable, match='a vehicle of kind "crazyflie-sim"'):
        reading(healthy, "vehicle.heartbeat")
    with pytest.raises(Unavailable, match='a vehicle of kind "sim"'):
        reading(made(tmp_path, "sim"), "crazyflie.battery")


class Seen:
    """A motion capture that answers."""

    def __init__(self, *_):
        pass

    def wait_for_bodies(self):
        return self


def test_motion_capture_or_radio_that_is_not_there_is_told(tmp_path, monkeypatch):
    def missing(*_):
        raise WireError("motion capture at 192.168.1.10 cannot be reached")

    context = made(tmp_path, "crazyflie")
    monkeypatch.setattr(mocap_vrpn, "VrpnMocap", missing)
    with pytest.raises(Unavailable, match="motion capture at"):
        reading(context, "crazyflie.firmware")
    monkeypatch.setattr(mocap_vrpn, "VrpnMocap", Seen)
    with pytest.raises(Unavailable, match="is the Crazyradio plugged in"):
        reading(context, "crazyflie.firmware")


@pytest.mark.parametrize("rig", ["crazyflie-sim", "crazyflie"])
def test_fence_of_the_shipped_rigs_has_room_for_the_wall(tmp_path, rig):
    assert reading(made(tmp_path, rig), "gate.fence").value >= 0.0
