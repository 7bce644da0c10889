"""The table of kinds: what is refused, and that every kind does something where it is placed."""

import os
import resource
import signal

import pytest

from hil.assembly.node_table import fault_setting
from hil.assembly.plan import Plan
from hil.assembly.rig import load_rig
from hil.contract.messages import Faults
from hil.contract.node import Inbox, Node
from hil.faults import firmware, services
from hil.faults.kinds import KINDS, check_faults, read_parameters, with_faults
from kernel.toml_errors import ConfigError
from scenarios.faults import FaultTable

FIRMWARE_RIG = load_rig("px4-firmware")
ON_FIRMWARE = [one.kind for one in firmware.KINDS]
SIM, MODEL = load_rig("sim"), Plan("simple-i", "sim", None, "model").rig
SERVICES_OF_MODEL = fault_setting(MODEL, live=True).services


def table(kind, **values):
    return FaultTable.model_validate({"kind": kind, **values})


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_described_and_acts_with_its_defaults(kind):
    assert KINDS[kind].__doc__ and "." in kind
    one = KINDS[kind]
    rig = FIRMWARE_RIG if kind in ON_FIRMWARE else SIM
    setting = fault_setting(rig, live=one is not firmware.FirmwareReboot)
    check_faults([table(kind)], setting)
    assert set(one.places(read_parameters(table(kind)), setting)) <= set(setting.nodes)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            table("camera.frozn"),
            'there is no fault "camera.frozn"; did you mean "camera.frozen"\\? Known: camera.frozen',
        ),
        (table("mavlink.loss", shar=0.5), 'fault mavlink.loss: unknown key "shar"; did you mean "share"\\?'),
        (table("mavlink.loss", share=1.5), "share.*less than or equal to 1"),
        (table("camera.dark"), "has none: give --camera pictures"),
        (table("service.killed", service="brian"), 'no service "brian"; did you mean "brain"\\?'),
        (table("disk.full"), "only a live run has"),
        (table("service.killed", **{"for": 0.5}), "does not end, and cannot last 0.5 s: leave `for` out"),
    ],
)
def test_fault_that_cannot_act_is_refused(wrong, message):
    with pytest.raises(ConfigError, match=message):
        check_faults([wrong], fault_setting(MODEL, live=False))


def test_faults_of_simulated_devices_are_refused_on_real_ones():
    field = load_rig("field")
    for kind in ("motor.loss", "car.dead"):
        with pytest.raises(ConfigError, match="this rig has a real one"):
            check_faults([table(kind)], fault_setting(field, live=True))


@pytest.mark.parametrize("kind", ON_FIRMWARE)
def test_faults_of_a_firmware_are_refused_where_none_flies(kind):
    with pytest.raises(ConfigError, match=f"fault {kind}: acts on a real firmware .* fly the rig px4-firmware"):
        check_faults([table(kind)], fault_setting(SIM, live=False))


@pytest.mark.parametrize("kind", ["autopilot.reboot", "estimator.jump", "battery.sag", "motor.loss", "motor.slow"])
def test_faults_of_the_software_px4_are_refused_where_a_firmware_flies(kind):
    with pytest.raises(ConfigError, match=f"fault {kind}: acts on a software autopilot, not on a real firmware"):
        check_faults([table(kind)], fault_setting(FIRMWARE_RIG, live=False))


def test_faults_of_the_surroundings_act_whatever_autopilot_flies():
    check_faults([table("wind.gust"), table("magnet.off")], fault_setting(FIRMWARE_RIG, live=False))


def test_reboot_of_a_firmware_is_refused_in_a_live_run():
    with pytest.raises(ConfigError, match="without --live"):
        check_faults([table("firmware.reboot")], fault_setting(FIRMWARE_RIG, live=True))


def test_plan_refuses_an_unknown_fault(tmp_path):
    with pytest.raises(ConfigError, match="there is no fault"):
        Plan("simple-i", "sim", None, "model", faults=[table("nothing")])


def built(kind, service, live, monkeypatch, **values):
    """The faults of `kind` around the nodes of `service`, and the signals that their beginning sends."""
    sent = []
    monkeypatch.setattr(services.os, "kill", lambda pid, number: sent.append((pid, number)))
    monkeypatch.setattr(services.subprocess, "Popen", lambda words: sent.append(words[-1]) or Waker())
    tables, setting = [table(kind, service=service, **values)], fault_setting(MODEL, live=live)

    class Waker:
        def wait(self):
            sent.append("waited")

    for name in setting.services[service]:
        node = with_faults(name, lambda _, name=name: Idle(name), None, tables, setting, (0, "simple-i"))
        inbox = Inbox(node.inputs)
        for active in ((0,), ()):
            inbox.put("run/fault", Faults(0, active, (0,)))
            node.step(0, inbox)
    return sent


class Idle(Node):
    def __init__(self, name):
        self.name = name

    def step(self, now_ns, inbox):
        return []


@pytest.mark.parametrize(("kind", "number"), [("service.killed", signal.SIGKILL), ("service.stopped", signal.SIGSTOP)])
def test_live_process_of_several_nodes_is_struck_once(kind, number, monkeypatch):
    assert len(SERVICES_OF_MODEL["brain"]) > 1
    assert built(kind, "brain", True, monkeypatch) == [(os.getpid(), number)]


@pytest.mark.parametrize("kind", ["service.killed", "service.stopped"])
def test_process_is_not_struck_in_lockstep(kind, monkeypatch):
    assert built(kind, "brain", False, monkeypatch) == []


def test_stopped_process_goes_on_after_its_time(monkeypatch):
    wake, struck, waited = built("service.stopped", "brain", True, monkeypatch, **{"for": 0.2})
    assert wake == f"sleep 0.2; kill -CONT {os.getpid()}"
    assert (struck, waited) == ((os.getpid(), signal.SIGSTOP), "waited")


def test_full_disk_of_a_live_run_fills_no_disk_in_its_replay(monkeypatch):
    limits = []
    monkeypatch.setattr(services.resource, "setrlimit", lambda *one: limits.append(one))
    monkeypatch.setattr(services.signal, "signal", lambda *_: None)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    assert built("disk.full", "brain", False, monkeypatch) == [] and limits == []
    built("disk.full", "brain", True, monkeypatch)
    assert limits == [(resource.RLIMIT_FSIZE, (0, before[1])), (resource.RLIMIT_FSIZE, before)]
