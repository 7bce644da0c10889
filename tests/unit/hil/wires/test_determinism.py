"""The processor that is kept for the firmware, and the time that it is given."""

import os

import pytest

from hil.wires import WireError, determinism
from hil.wires.determinism import ReservedProcessor, SettledServer
from hil.wires.simulator import SimulatorServer
from vehicle.px4.codec import Packer


@pytest.fixture
def machine(monkeypatch):
    """The processors and the scheduler as this process sees them."""
    state = {"allowed": {0, 1, 5}, "policies": [], "permitted": True}

    def schedule(_, policy, parameters):
        if policy == os.SCHED_FIFO and not state["permitted"]:
            raise PermissionError
        state["policies"].append((policy, parameters.sched_priority))

    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(state["allowed"]))
    monkeypatch.setattr(os, "sched_setaffinity", lambda _, allowed: state.update(allowed=set(allowed)))
    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    return state


def test_one_processor_is_left_to_the_firmware_until_it_is_released(machine):
    reserved = ReservedProcessor()
    assert (reserved.number, machine["allowed"]) == (5, {0, 1})
    assert [policy for policy, _ in machine["policies"]] == [os.SCHED_FIFO, os.sched_getscheduler(0)]
    reserved.release()
    reserved.release()
    assert machine["allowed"] == {0, 1, 5}


@pytest.mark.parametrize(
    ("change", "text"),
    [({"allowed": {3}}, "needs two processors"), ({"permitted": False}, "needs real-time priority .* run as root")],
)
def test_machine_that_does_not_permit_it_is_told(machine, change, text):
    machine.update(change)
    before = set(machine["allowed"])
    with pytest.raises(WireError, match=f"deterministic = true {text}"):
        ReservedProcessor()
    assert machine["allowed"] == before


def test_firmware_gets_time_at_its_start_and_after_each_fix(monkeypatch):
    monkeypatch.setattr(SimulatorServer, "__init__", lambda self, host, port: None)
    monkeypatch.setattr(SimulatorServer, "send", lambda self, data: None)
    slept = []
    server, packer = SettledServer(sleep=slept.append), Packer(245, 51)
    sensor = packer.send_name("HIL_SENSOR", 1, *(0.0,) * 13, 0, 0)
    fix = packer.send_name("HIL_GPS", 1, 3, *(0,) * 13)
    server.send(fix)
    for _ in range(300):
        server.send(sensor)
    server.send(fix)
    steps = determinism._SLOW_STEPS
    assert slept == [0.002, 4.0, *[0.03] * steps, 0.002]
