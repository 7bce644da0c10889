"""The autopilot's log after a live flight: when it is fetched, from where, and that no failure is raised."""

from types import SimpleNamespace

import pytest

from hil.assembly.rig import Rig, load_rig
from hil.bench import flight_log, ground
from hil.bench.flight_log import fetch_log, log_link
from hil.cli.run import _fetch_log
from hil.contract.messages import VehicleStatus
from hil.recording.recorder import Recorder
from tests.unit.hil.bench.px4_link import LOGS, link


def slot(**vehicle):
    of_mavlink = {"kind": "mavlink", "url": "udp://:14540"}
    return Rig(title="t", vehicle=of_mavlink | vehicle, mocap={"kind": "vrpn", "server": "host"}).vehicle


def flown(folder, *armed):
    """A run's recording in which the autopilot was armed at these moments."""
    path = folder / "run.mcap"
    with Recorder(path) as recorder:
        for now, one in enumerate(armed):
            recorder(now, "vehicle/status", VehicleStatus(now, True, one, False, False, "AUTO", "hover", 16.0, 0.5))
    return path


@pytest.mark.parametrize(
    ("vehicle", "remote", "wanted"),
    [
        ({}, (), "udp://:14540"),
        ({"ground_url": "udp://:14550"}, (), "udp://:14550"),
        ({"log_limit_s": 0}, (), ""),
        ({"signing_key": "vehicle.key"}, (), ""),
        ({}, ("vehicle_link",), ""),
        ({"ground_url": "udp://:14550"}, ("vehicle_link",), "udp://:14550"),
        ({"kind": "crazyflie", "url": "udp://127.0.0.1:19850", "external_pose": True}, (), ""),
        ({"kind": "hitl", "url": "", "simulator": "tcp://:4560"}, (), ""),
    ],
)
def test_log_comes_over_the_ground_stations_link_else_the_offboard_link(vehicle, remote, wanted):
    rig = Rig(
        title="t", vehicle={"kind": "mavlink", "url": "udp://:14540"} | vehicle, mocap={"kind": "vrpn", "server": "s"}
    )
    assert log_link(rig.vehicle, remote) == wanted


def test_simulated_rig_has_no_log_and_px4_sitl_has_one():
    assert log_link(load_rig("sim").vehicle, ()) == log_link(load_rig("px4-firmware").vehicle, ()) == ""
    assert log_link(load_rig("px4-sitl").vehicle, ()) == "udp://:14540"


def test_newest_log_comes_into_the_folder_of_a_flight_that_was_armed(with_logs, tmp_path):
    shares = []
    line = fetch_log(link(with_logs), slot(), tmp_path, flown(tmp_path, False, True, False), shares.append)
    assert (tmp_path / "autopilot.ulg").read_bytes() == LOGS[2], line
    assert str(tmp_path / "autopilot.ulg") in line and shares[-1] == 1.0
    assert fetch_log("udp://127.0.0.1:1", slot(), tmp_path, tmp_path / "run.mcap") == ""  # it is there already


@pytest.mark.parametrize(
    ("armed", "words"), [((), ""), ((False, False), ""), ((False, True), "still armed; later: perch-hil vehicle log")]
)
def test_flight_that_was_never_armed_or_is_still_armed_asks_for_no_log(armed, words, tmp_path):
    line = fetch_log("not an address", slot(), tmp_path, flown(tmp_path, *armed))
    assert words in line and bool(line) == bool(words)


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), RuntimeError(), ground.Refused("none")])
def test_whatever_fails_is_one_line_that_says_how_to_fetch_it_later(error, tmp_path, monkeypatch):
    def fails(*_):
        raise error

    monkeypatch.setattr(ground, "GroundStation", fails)
    line = fetch_log("udp://:14550", slot(), tmp_path, flown(tmp_path, True, False))
    assert "not fetched" in line and f"perch-hil vehicle log {tmp_path} --link udp://:14550" in line
    assert "\n" not in line and [one.name for one in tmp_path.iterdir()] == ["run.mcap"]


def test_damaged_recording_asks_for_no_log(tmp_path):
    (tmp_path / "run.mcap").write_bytes(b"torn")
    assert fetch_log("not an address", slot(), tmp_path, tmp_path / "run.mcap") == ""


def test_link_that_is_too_slow_is_given_up_by_its_own_speed(with_logs, tmp_path, monkeypatch):
    monkeypatch.setattr(flight_log, "_JUDGED_S", 0.0)
    with with_logs.held() as autopilot:
        autopilot.receiver._handlers["LOG_REQUEST_DATA"] = lambda *_: None
    line = fetch_log(link(with_logs), slot(log_limit_s=0.5), tmp_path, flown(tmp_path, True, False))
    assert "log_limit_s = 0.5" in line and [one.name for one in tmp_path.iterdir()] == ["run.mcap"]


class Bar:
    """A line of progress that is not shown."""

    def update(self, *_, **__): ...
    def start(self): ...
    def stop(self): ...


@pytest.mark.parametrize(("raised", "goes_on"), [(None, True), (KeyboardInterrupt, False)])
def test_ctrl_c_while_a_log_comes_ends_the_seeds_and_is_told(raised, goes_on, tmp_path, monkeypatch):
    def fetch(*_):
        if raised:
            raise raised
        return "a line"

    monkeypatch.setattr(flight_log, "fetch_log", fetch)
    said = []
    notes = SimpleNamespace(print=lambda text, **_: said.append(text))
    run = SimpleNamespace(path=tmp_path, recording=tmp_path / "run.mcap")
    one = SimpleNamespace(flight=SimpleNamespace(run=run, interrupted=False))
    plan = SimpleNamespace(rig=SimpleNamespace(vehicle=slot()))
    assert _fetch_log(SimpleNamespace(live=True, remote=()), plan, one, Bar(), None, notes) is goes_on
    assert len(said) == 1
