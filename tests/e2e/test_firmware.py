"""The rig of the real firmware in lockstep: with a stand-in for PX4 in every suite, and with PX4 where it is built.

PERCH_HIL_PX4 (environment) names PX4's build folder; without it the tests with the real firmware are skipped.
"""

import json
import os
import socket

import pytest
from typer.testing import CliRunner

from hil.assembly import hitl
from hil.assembly.rig import RIG_DIR, load_rig
from hil.cli.main import app
from hil.contract.messages import Event
from hil.live.reach import reach
from hil.recording.reader import Recording
from hil.recording.runs import list_runs
from hil.wires import WireError
from hil.wires.settled import IdleCore
from tests.fake_firmware import build_folder

REAL = os.environ.get(hitl.BUILD, "")
FIRMWARES = [
    "stand-in",
    pytest.param("real", marks=pytest.mark.skipif(not REAL, reason=f"{hitl.BUILD} names no build of PX4's SITL")),
]


@pytest.fixture(params=FIRMWARES)
def firmware(request, tmp_path, monkeypatch):
    """PX4's build folder, in the environment."""
    folder = REAL if request.param == "real" else str(build_folder(tmp_path / "build"))
    monkeypatch.setenv(hitl.BUILD, folder)
    return request.param


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    monkeypatch.setenv(hitl.BUILD, str(build_folder(tmp_path / "build")))


def fly(tmp_path, *options, scenario="simple-i"):
    arguments = [
        "run",
        scenario,
        "--rig",
        "px4-firmware",
        "--camera",
        "model",
        "--json",
        "--out",
        str(tmp_path / "runs"),
    ]
    result = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "runs"), *options])
    (run,) = list_runs(tmp_path / "runs")
    return result, run


def events(run):
    return [e.message for e in Recording(run.recording).messages() if isinstance(e.message, Event)]


def test_firmware_flies_an_attempt_in_lockstep(firmware, tmp_path):
    result, run = fly(tmp_path)
    assert result.exit_code in (0, 1), result.output
    row = json.loads(result.stdout)
    assert row["run_dir"] == str(run.path)
    assert (run.manifest["state"], run.manifest["identity"]) == ("finished", "sim")
    assert run.manifest["rig"]["name"] == "px4-firmware"
    assert (run.path / "firmware.log").exists()
    if firmware == "real":
        assert result.exit_code == 0, "it perches"
        assert (run.path / "firmware.ulg").stat().st_size > 100_000
    said = [event.text for event in events(run)]
    assert any("autopilot: Takeoff detected" in text for text in said), said
    assert not any(text.startswith("firmware: ") for text in said), said


@pytest.fixture
def deterministic(tmp_path):
    """A rig with a deterministic firmware, where this machine permits one."""
    try:
        IdleCore().close()
    except WireError as error:
        pytest.skip(str(error))
    text = (RIG_DIR / "px4-firmware.toml").read_text(encoding="utf-8")
    path = tmp_path / "twice.toml"
    path.write_text(text.replace('kind = "hitl"', 'kind = "hitl"\ndeterministic = true'), encoding="utf-8")
    return str(path)


def test_deterministic_firmware_flies_the_same_flight_twice(firmware, deterministic, tmp_path):
    runs = [fly(tmp_path / name, "--rig", deterministic)[1] for name in ("first", "second")]
    assert all(run.manifest["state"] == "finished" for run in runs)
    result = CliRunner().invoke(app, ["diff", *(str(run.path) for run in runs)])
    assert result.exit_code == 0, result.output


def test_deterministic_firmware_is_refused_where_it_cannot_be_had(deterministic, tmp_path, monkeypatch):
    asked = ["run", "simple-i", "--rig", deterministic, "--out", str(tmp_path / "runs")]
    monkeypatch.delenv(hitl.BUILD, raising=False)
    result = CliRunner().invoke(app, asked)
    assert result.exit_code == 3 and "name PX4's build folder by px4 or PERCH_HIL_PX4" in result.output
    result = CliRunner().invoke(app, [*asked, "--live"])
    assert result.exit_code == 2 and "fly without --live" in result.output


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("exit", "the firmware has ended with exit code 1"),
        ("no-lockstep", "built without lockstep"),
        ("leave", "has left"),
    ],
)
def test_firmware_that_cannot_be_flown_ends_the_run_with_its_cause(stand_in, tmp_path, monkeypatch, fault, text):
    monkeypatch.setenv("FAKE_FIRMWARE", fault)
    result, run = fly(tmp_path)
    assert result.exit_code == 3, result.output
    assert run.manifest["state"] == "failed"
    assert any(text in event.text for event in events(run))


def test_firmware_that_never_answers_does_not_fly(stand_in, tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_FIRMWARE", "mute")
    monkeypatch.setattr("hil.wires.simulator.BOOT_PATIENCE_S", 0.0)
    result, run = fly(tmp_path)
    assert result.exit_code == 3, result.output
    assert any("never answered" in event.text for event in events(run))


def test_build_folder_without_px4_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv(hitl.BUILD, str(tmp_path))
    result = CliRunner().invoke(app, ["run", "simple-i", "--rig", "px4-firmware", "--out", str(tmp_path / "runs")])
    assert result.exit_code == 3
    assert "bin/px4 is missing" in result.stderr
    assert not (tmp_path / "runs").exists()


def test_two_runs_at_once_take_two_instances(stand_in):
    slot = load_rig("px4-firmware").vehicle
    first = hitl.free_instance(slot)
    with socket.socket() as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        taken.bind(("127.0.0.1", 4560 + first))
        taken.listen(1)
        assert hitl.free_instance(slot) > first
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as firmware:
        firmware.bind(("127.0.0.1", 14580 + first))
        assert hitl.free_instance(slot) > first, "one that flies its own simulation listens there"


def test_rig_check_says_what_a_run_would_start(stand_in, tmp_path):
    vehicle = reach(load_rig("px4-firmware"), listen_s=0.1)[0]
    assert vehicle.ok and "each run starts" in vehicle.text and str(tmp_path) in vehicle.text
