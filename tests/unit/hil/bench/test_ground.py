"""The ground station's link by MAVSDK, against the software PX4 over UDP, which a test gives a few logs to serve."""

import json
import socket
import time
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from hil.assembly.rig import Rig
from hil.bench import ground
from hil.bench.devices import Context
from hil.bench.ground import GroundStation, Refused
from hil.bench.ground_health import CHECKS, Health, Problem
from hil.bench.reading import NotApplicable, Unavailable
from hil.check.items_ground import calibration, health
from hil.cli.main import app
from scenarios.spec import load
from tests.unit.hil.bench.px4_link import LIMIT_S, LOGS, link


def wait(condition):
    until = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def command(*arguments):
    return CliRunner().invoke(app, ["vehicle", *map(str, arguments)])


def test_healthy_autopilot_is_armable_and_gives_no_reasons(px4):
    result = command("health", "--link", link(px4), "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert found["armable"] and found["reasons"] == [] and set(found["checks"]) == set(CHECKS)
    assert all(found["checks"].values())


def test_autopilot_that_is_not_ready_says_why(px4):
    with px4.held() as autopilot:
        autopilot.flight.ready, autopilot.commander._ready_ns = False, 10**18
    with GroundStation(link(px4)) as station:
        with px4.held() as autopilot:
            autopilot.outbox.text(2, "Preflight Fail: Compass Sensor 0 missing\t")
        wait(lambda: station._texts)
        found = station.health(2.0)
    assert not found.armable and not found.events
    assert "Preflight Fail: Compass Sensor 0 missing" in found.reasons()


def test_parameters_are_set_by_their_type_and_read_back(px4):
    result = command("set", "COM_OF_LOSS_T", "0.4", "--link", link(px4))
    assert result.exit_code == 0 and result.output == "COM_OF_LOSS_T: 1 -> 0.4\n", result.output
    assert command("set", "COM_OBL_RC_ACT", "4", "--link", link(px4)).exit_code == 0
    with px4.held() as autopilot:
        assert autopilot.flight.parameters["COM_OBL_RC_ACT"] == 4
    for arguments, words in ((("COM_OBL_RC_ACT", "1.5"), "whole number"), (("NO_SUCH", "1"), "no such parameter")):
        result = command("set", *arguments, "--link", link(px4))
        assert result.exit_code == 1 and words in result.output and len(result.output.splitlines()) == 1


def test_nothing_is_changed_on_an_armed_vehicle_and_a_sitl_does_not_reboot(px4):
    with GroundStation(link(px4)) as station:
        with pytest.raises(Refused, match="denied"):
            station.reboot()
        with px4.held() as autopilot:
            autopilot.flight.parameters.values["COM_DISARM_PRFLT"] = -1.0
            autopilot.commander.arm("external command")
        wait(lambda: station._telemetry.armed())
        for change in (station.reboot, lambda: station.set_parameter("COM_OF_LOSS_T", 0.4)):
            with pytest.raises(Refused, match="armed"):
                change()


def test_newest_log_is_fetched_whole_into_the_runs_folder(with_logs, tmp_path):
    result = command("logs", "--link", link(with_logs), "--json")
    assert [(one["id"], one["size"]) for one in json.loads(result.output)] == [(n, len(d)) for n, d in LOGS.items()]
    result = command("log", tmp_path, "--link", link(with_logs))
    assert result.exit_code == 0, result.output
    assert (tmp_path / "autopilot.ulg").read_bytes() == LOGS[2]
    assert "is there already" in command("log", tmp_path, "--link", link(with_logs)).output
    assert command("log", tmp_path / "old.ulg", "--id", "1", "--link", link(with_logs)).exit_code == 0
    assert (tmp_path / "old.ulg").read_bytes() == LOGS[1]
    assert command("log", tmp_path, "--id", "9", "--link", link(with_logs)).exit_code == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["autopilot.ulg", "old.ulg"]


def test_log_that_stops_coming_leaves_nothing_behind(with_logs, tmp_path, monkeypatch):
    monkeypatch.setattr(ground, "_STALLED_S", 1.0)
    with with_logs.held() as autopilot:
        autopilot.receiver._handlers["LOG_REQUEST_DATA"] = lambda *_: None
    result = command("log", tmp_path, "--link", link(with_logs))
    assert result.exit_code == 3 and len(result.output.splitlines()) == 1, result.output
    assert not list(tmp_path.iterdir())


def test_no_autopilot_a_port_in_use_and_a_wrong_address_are_told_in_one_line():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("0.0.0.0", 0))
        port = taken.getsockname()[1]
        for url, words in (
            (f"udp://:{port}", "in use"),
            (f"udp://127.0.0.1:{port}", "no autopilot"),
            ("14550", "not an address"),
        ):
            with pytest.raises(Unavailable, match=words) as told:
                GroundStation(url, wait_s=0.5)
            assert "\n" not in str(told.value)


class Heard:
    """A MAVSDK client that hears autopilots of these systems."""

    def __init__(self, *numbers):
        self.systems = [SimpleNamespace(get_system_id=lambda n=n: n, has_autopilot=lambda: True) for n in numbers]

    def first_autopilot(self, wait_s):
        return next(iter(self.systems), None)

    def get_systems(self):
        return self.systems


@pytest.mark.parametrize(
    ("heard", "system", "words"),
    [
        ((1, 6), 0, r"several autopilots \(systems 1, 6\)"),
        ((1,), 6, r"MAV_SYS_ID 6 .*heard: 1"),
        ((), 0, "no autopilot"),
    ],
)
def test_autopilot_that_is_not_the_only_one_has_to_be_named(monkeypatch, heard, system, words):
    monkeypatch.setattr(ground, "_BEAT_S", 0.0)
    station = GroundStation.__new__(GroundStation)
    station._url, station._client = "udp://:14550", Heard(*heard)
    with pytest.raises(Unavailable, match=words):
        station._find(system, 0.0)
    station._client = Heard(1, 6)
    assert station._find(6, 0.0).get_system_id() == 6


def test_log_needs_a_folder():
    assert command("log", "nowhere/deep").exit_code == 2


def test_reasons_are_the_events_that_are_errors_then_the_texts():
    checks = dict.fromkeys(CHECKS, False)
    problems = [
        Problem("No valid mission available", "Upload a mission first.", "info", "system"),
        Problem("GPS fix too low", "", "error", "gps"),
    ]
    found = Health(
        checks, problems, ["Preflight Fail: x", "Preflight Fail: x", "Preflight Fail: GPS fix too low"], True
    )
    assert found.reasons() == ["GPS fix too low (gps)", "Preflight Fail: x"]
    assert Health(checks, [], [], True).reasons()[0] == "no gyro calibration"
    assert Health({**checks, "armable": True}, problems, ["x"], True).reasons() == []


def context(tmp_path, **vehicle):
    rig = Rig(title="t", vehicle={"kind": "mavlink", "url": "udp://:14540", **vehicle})
    return Context("t", rig, "vision", load("simple-i"), tmp_path)


def test_checklist_reads_the_ground_stations_link_once(px4, tmp_path):
    about = context(tmp_path, ground_url=link(px4))
    assert health(about).ok and health(about).value is True
    assert calibration(about).value == 0
    about._kept["station"] = Health(
        {**dict.fromkeys(CHECKS, True), "gyro calibration": False, "armable": False}, [], [], 0
    )
    assert (calibration(about).value, calibration(about).detail) == (1, "gyro calibration")
    assert not health(about).ok and "no gyro calibration" in health(about).detail


def test_rig_without_a_ground_stations_link_skips_the_item(tmp_path):
    with pytest.raises(NotApplicable, match="ground_url"):
        health(context(tmp_path))


def test_ground_stations_link_belongs_to_a_real_autopilot():
    with pytest.raises(ValueError, match="ground_url"):
        Rig(title="t", vehicle={"kind": "sim", "ground_url": "udp://:14550"})
