"""The rig px4-sitl against the software PX4 as a process of its own on UDP, with the quirks of a real SITL: it boots by
itself, speaks first, keeps its first partner, lags wall time, and drifts on its simulated GPS.

Nothing here depends on how well the attempt goes: the machine may be busy. It must take place, and end on the ground.
"""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from hil.assembly.plan import Plan
from hil.assembly.rig import RIG_DIR
from hil.live.run import fly_live
from hil.recording import provenance
from hil.recording.reader import Recording

pytestmark = [pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.usefixtures("real_time")]
PROGRAM = Path(__file__).parent / "px4_process.py"


@contextlib.contextmanager
def autopilot(port, speed):
    """A running PX4; the dict that it yields holds its report of the flights at the end."""
    process = subprocess.Popen(
        [sys.executable, str(PROGRAM), str(port), str(speed)], stdout=subprocess.PIPE, text=True, bufsize=1
    )
    report = {}
    try:
        assert process.stdout.readline() == "booted\n"
        yield report
    finally:
        process.terminate()
        report |= json.loads(process.communicate(timeout=20)[0])


@pytest.fixture
def site(tmp_path):
    """(port, names of a run): the rig as it comes, on a free port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    rig = tmp_path / "px4-sitl.toml"
    rig.write_text((RIG_DIR / "px4-sitl.toml").read_text().replace("14540", str(port)))
    return port, {"scenario": "simple-i", "rig": str(rig), "policy": None, "camera": "model"}


def fly(names, out, progress=lambda now_ns, what: None):
    return fly_live(
        Plan(**names), names, 0, pictures="none", out=out, code=provenance.code(), progress=progress
    )  # fmt: skip


def event_texts(run):
    return [entry.message.text for entry in Recording(run.path).messages(["event"])]


@pytest.mark.parametrize("flights", [1, pytest.param(2, marks=pytest.mark.live)])
def test_one_autopilot_flies_flight_after_flight(site, tmp_path, flights):
    port, names = site
    with autopilot(port, 0.97) as report:
        for flight in range(flights):
            live = fly(names, tmp_path / "runs")
            events = event_texts(live.flight.run)
            assert live.flight.failure == "", events[-6:]
            assert live.flight.run.manifest["identity"] == "real"
            for text in ("stage attempt", "mode OFFBOARD"):
                assert text in events
            if flight == 0:
                assert "COM_OF_LOSS_T set to 0.3 (was 1)" in events
            recording = Recording(live.flight.run.path)
            statuses = [e.message for e in recording.messages(["vehicle/status"])]
            assert {"parameters", "ready", "takeoff", "goto", "hover", "handed_over"} <= {
                status.phase for status in statuses
            }
            assert (statuses[-1].phase, statuses[-1].armed) == ("released", False)
            after = events[events.index("stage attempt") :]  # before it: what the last flight has left
            assert "mode AUTO.LAND" in after, "handed back, landed, disarmed"
            sent = [e.message for e in recording.messages(["vehicle/sent"])]
            assert len(sent) > 100, "a second of body rates at least"
            assert 0.3 < statuses[-1].hover_thrust < 0.7
    assert report["armed"] == flights
    assert not report["armed_now"]
    assert report["position"][2] < 0.2
    assert set(report["rejected"]) <= {"ignored_frames"}
    assert report["fastest_fall"] < 4.0, "nothing fell: the board is virtual, the motors went on"


@pytest.mark.live
def test_vehicle_lands_and_disarms_when_the_policy_service_is_killed(site, tmp_path):
    port, names = site
    out = tmp_path / "runs"
    done = []

    def inject_fault(now_ns, stage):
        if stage == "attempt" and not done:
            done.append(service(out, "brain"))
            os.kill(done[0], signal.SIGKILL)

    with autopilot(port, 0.97) as report:
        live = fly(names, out, inject_fault)
        assert "brain was killed by SIGKILL" in live.flight.failure
        events = event_texts(live.flight.run)
        assert "mode AUTO.LAND" in events
        assert Recording(live.flight.run.path).complete
    assert (report["armed"], report["armed_now"]) == (1, False)
    assert report["position"][2] < 0.2


@pytest.mark.live
def test_silent_autopilot_in_flight_is_reported_and_recording_complete(site, tmp_path):
    port, names = site
    process = subprocess.Popen([sys.executable, str(PROGRAM), str(port), "0.97"], stdout=subprocess.PIPE, text=True)

    def inject_fault(now_ns, stage):
        if stage == "attempt" and process.poll() is None:
            process.kill()

    try:
        assert process.stdout.readline() == "booted\n"
        live = fly(names, tmp_path / "runs", inject_fault)
    finally:
        process.kill()
        process.communicate(timeout=20)
    assert "has not published" in live.flight.failure
    assert live.flight.run.manifest["state"] == "failed"
    assert "link lost: no HEARTBEAT for 3 s" in event_texts(live.flight.run)
    assert Recording(live.flight.run.path).complete


def service(folder, name):
    """The pid of the process that serves `name` in a run below `folder`."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            words = path.read_bytes().split(b"\0")
            if len(words) > 4 and words[3].startswith(str(folder).encode()) and words[4].decode() == name:
                return int(path.parent.name)
    raise AssertionError(f"no process serves {name}")
