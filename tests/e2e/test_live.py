"""Live runs, a process a service: what a run leaves, and what happens to it when a service dies, stops or hangs.

The machine may be busy: nothing here depends on how fast it is. An attempt may fail because of that, but the run says
what happened, its recording can be read and replayed, and nobody is left behind.
"""

import json
import os
import signal
import time
from pathlib import Path

import pytest

from hil import provenance
from hil.campaign import Plan
from hil.host.live_run import fly_live
from hil.host.replay import replay_run
from hil.reader import Recording

pytestmark = pytest.mark.live

NAMES = {"scenario": "simple-i", "rig": "sim", "policy": None, "camera": "model"}
CODE = provenance.code()


def fly(out, progress=lambda now_ns, what: None):
    return fly_live(Plan(**NAMES), NAMES, 0, pictures="none", out=out, code=CODE, progress=progress)


def processes(folder):
    """service -> pid of the processes that serve the run in `folder`."""
    found = {}
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().split(b"\0")
        except OSError:
            continue
        if len(words) > 4 and words[3].startswith(str(folder).encode()):
            found[words[4].decode()] = int(path.parent.name)
    return found


def nobody_left(out):
    until = time.monotonic() + 5.0
    while processes(out) and time.monotonic() < until:
        time.sleep(0.05)
    return not processes(out)


class Strike:
    """A progress callback that hits one service once the run's clock has passed `after_s`."""

    def __init__(self, out, service, number, after_s=1.5):
        self.out, self.service, self.number, self.after_ns, self.done = out, service, number, after_s * 1e9, False

    def __call__(self, now_ns, what):
        if not self.done and now_ns > self.after_ns:
            self.done = True
            if self.service == "":
                raise KeyboardInterrupt
            os.kill(processes(self.out)[self.service], self.number)


def test_a_live_run_leaves_what_a_lockstep_run_leaves_and_can_be_replayed(tmp_path):
    live = fly(tmp_path)
    run = live.flight.run
    assert nobody_left(tmp_path)
    manifest = run.manifest
    assert (manifest["host"], manifest["identity"], manifest["state"]) == ("live", "sim", "finished")
    assert run.score is not None
    recording = Recording(run.path)
    assert recording.complete
    assert recording.faults == []
    events = [entry.message.text for entry in recording.messages(["event"])]
    assert "stage ended" in events or any("not hovering" in text for text in events)
    stamps = [entry.log_ns for entry in recording.messages()]
    assert stamps == sorted(stamps)
    table = json.loads((run.path / "live.json").read_text())
    nodes = {name for one in table["services"].values() for name in one["nodes"]}
    assert nodes >= {"vehicle_device", "vehicle_link", "car_link", "camera", "belief", "policy", "referee", "director"}
    assert all(one["state"] == "stopped" for name, one in table["services"].items())
    found = replay_run(run.path)
    assert {t.topic for t in found.topics} >= {"belief", "run/stage", "car/command", "mocap/board"}
    if not any("not in the recording" in t.first for t in found.topics):  # the bus may drop under load, and says so
        assert found.same, found.lines()


@pytest.mark.parametrize(
    ("service", "number", "text"),
    [
        ("brain", signal.SIGKILL, "brain was killed by SIGKILL"),
        ("vehicle_link", signal.SIGKILL, "vehicle_link was killed by SIGKILL"),
        ("recorder", signal.SIGKILL, "recorder was killed by SIGKILL"),
        ("hub", signal.SIGKILL, "hub was killed by SIGKILL"),
        ("mocap", signal.SIGSTOP, "mocap"),
        ("", signal.SIGINT, ""),
    ],
)
def test_a_service_that_dies_or_stops_ends_the_run_safely(tmp_path, service, number, text):
    live = fly(tmp_path, Strike(tmp_path, service, number))
    assert nobody_left(tmp_path)
    run = live.flight.run
    assert text in live.flight.failure
    assert live.flight.interrupted == (service == "")
    assert run.manifest["state"] == ("interrupted" if service == "" else "failed")
    assert not live.flight.score.within_tolerance
    recording = Recording(run.path)
    assert sum(1 for _ in recording.messages(["truth/vehicle"])) > 50
    assert recording.complete == (service != "recorder")
