"""Live runs, a process a service: what a run leaves, and what happens to it when a service dies, stops or hangs.

The machine may be busy: nothing here depends on how fast it is. An attempt may fail because of that, but the run
reports it, its recording can be read and replayed, and no process is left behind. Each run takes 40 to 60 s on two
cores with other work on them, all of them half an hour: eleven services, each killed, stopped and hung. The first is
part of `make test`, the others of `make live`.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.assembly.plan import Plan
from hil.host.replay import replay_run
from hil.live.orphaned import mapped_memory
from hil.live.run import fly_live
from hil.recording import provenance
from hil.recording.reader import Recording

pytestmark = pytest.mark.usefixtures("real_time")

NAMES = {"scenario": "simple-ii", "rig": "sim", "policy": None, "camera": "model"}
CODE = provenance.code()


def fly(out, progress=lambda now_ns, what: None, camera="model"):
    names = {**NAMES, "camera": camera}
    return fly_live(Plan(**names), names, 0, pictures="none", out=out, code=CODE, progress=progress)


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


def no_process_left(out):
    until = time.monotonic() + 5.0
    while processes(out) and time.monotonic() < until:
        time.sleep(0.05)
    return not processes(out)


def memory_left(fault):
    """Files in shared memory that were the run's when it was struck, and are still there."""
    return [name for name in fault.memory if Path("/dev/shm", name).exists()]


class Fault:
    """A progress callback that hits one service `after_s` into a stage of the run."""

    def __init__(self, out, service, number, stage="attempt", after_s=0.3):
        self.out, self.service, self.number, self.stage, self.after_ns = out, service, number, stage, after_s * 1e9
        self.since_ns, self.done, self.memory = None, False, set()

    def __call__(self, now_ns, what):
        if not self.memory and (now_ns or what.startswith(self.stage)):  # a second's work: not in the attempt
            self.memory = set().union(*(mapped_memory(pid) for pid in processes(self.out).values()))
        if self.done or not what.startswith(self.stage):
            return
        self.since_ns = now_ns if self.since_ns is None else self.since_ns
        if now_ns - self.since_ns >= self.after_ns:
            self.done = True
            if self.service == "":
                raise KeyboardInterrupt
            os.kill(processes(self.out)[self.service], self.number)


@pytest.mark.slow
def test_live_run_leaves_the_files_of_a_lockstep_run_and_replays(tmp_path):
    live = fly(tmp_path)
    run = live.flight.run
    assert no_process_left(tmp_path)
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
    for name, one in table["services"].items():  # on a busy machine one may not end in time; the run says so
        assert one["state"] == "stopped" or any(remark.startswith(name) for remark in table["remarks"])
    found = replay_run(run.path)
    assert {t.topic for t in found.topics} >= {"belief", "run/stage", "car/command", "mocap/board"}
    if not any("not in the recording" in t.first for t in found.topics):  # the bus reports drops under load
        assert found.same, found.lines()


KILL, STOP, BUSY = signal.SIGKILL, signal.SIGSTOP, signal.SIGUSR1
STRUCK = {KILL: "{} was killed by SIGKILL", STOP: "{} does not answer", BUSY: "{} does not answer"}
SERVICES = (
    "vehicle_device", "car_device", "mocap", "vehicle_link", "car", "camera", "detector", "brain", "referee",
    "recorder", "hub",
)  # fmt: skip


@pytest.fixture
def can_hang(tmp_path, monkeypatch):
    """Every process of a run started now loops for ever in its main thread once it gets SIGUSR1."""
    folder = tmp_path / "site"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(
        "import signal\n\n\ndef hang(*_):\n    while True:\n        pass\n\n\nsignal.signal(signal.SIGUSR1, hang)\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(folder))


@pytest.mark.live
@pytest.mark.parametrize("number", [KILL, STOP, BUSY], ids=["kill", "stop", "busy"])
@pytest.mark.parametrize("service", SERVICES)
def test_killed_service_in_the_attempt_ends_in_the_safe_state(tmp_path, can_hang, service, number):
    out, fault = tmp_path / "runs", Fault(tmp_path, service, number)
    live = fly(out, fault, "pictures" if service == "detector" else "model")
    assert fault.done
    assert no_process_left(tmp_path)
    assert not memory_left(fault)
    run, remarks = live.flight.run, live.summary["remarks"]
    recording = Recording(run.path)
    logs = {name: (run.path / "live" / f"{name}.log").read_text() for name in live.summary["services"]}
    if (service, number) == ("hub", BUSY):  # its threads go on without the interpreter: the run does not notice
        assert live.flight.failure == ""
        assert "hub had to be stopped with SIGKILL" in remarks
        return
    assert STRUCK[number].format(service) in live.flight.failure
    assert run.manifest["state"] == "failed"
    assert not live.flight.score.within_tolerance
    truth = [entry.message for entry in recording.messages(["truth/vehicle"])]
    assert len(truth) > 50
    assert recording.complete == (service != "recorder")
    if service == "vehicle_device":  # the simulated vehicle has ended, so nothing reports it
        assert any(remark.startswith("vehicle_link did not report") for remark in remarks)
    elif service == "vehicle_link":  # the autopilot lands by itself
        assert truth[-1].velocity[2] < -0.2 or truth[-1].position[2] < 0.4
    elif service == "hub":  # every driver notices by itself
        for driver in ("vehicle_link", "car"):
            assert f"{driver}: aborted" in logs[driver]
            assert f"{driver}: safe at the end" in logs[driver]
    else:
        assert live.summary["services"]["vehicle_link"]["safe"]
    if service not in ("car_device", "hub", "recorder"):
        board = [entry.message for entry in recording.messages(["truth/board"])]
        assert max(message.speed for message in board) > 0.3
        assert abs(board[-1].speed) < 0.1


@pytest.mark.live
def test_full_disk_in_flight_ends_in_the_safe_state(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, before[1]))  # of every file of every service
    try:
        live = fly(tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert live.flight.failure.startswith("recorder ended with exit code 3: ")
    assert live.flight.failure.endswith("File too large")
    assert live.flight.run.manifest["state"] == "failed"
    assert live.summary["services"]["vehicle_link"]["safe"]
    assert no_process_left(tmp_path)


@pytest.mark.live
@pytest.mark.parametrize("stage", ["waiting", "attempt"])
def test_an_interrupted_run_ends_in_the_safe_state(tmp_path, stage):
    fault = Fault(tmp_path, "", 0, stage, 0.0)
    live = fly(tmp_path, fault)
    assert no_process_left(tmp_path)
    assert not memory_left(fault)
    run = live.flight.run
    assert live.flight.interrupted
    assert run.manifest["state"] == "interrupted"
    if stage == "attempt":
        assert Recording(run.path).complete
        assert live.summary["services"]["vehicle_link"]["safe"]


@pytest.mark.live
def test_services_reach_the_safe_state_when_the_supervisor_is_killed(tmp_path):
    with (tmp_path / "output").open("wb") as logs:
        run = subprocess.Popen(
            [Path(sys.executable).with_name("perch-hil"), "run", "simple-ii", "--camera", "model", "--live",
             "--pictures", "none", "--out", tmp_path / "runs"], stdout=logs, stderr=logs,
        )  # fmt: skip
    until = time.monotonic() + 120.0
    while not any(path.stat().st_size > 150_000 for path in tmp_path.glob("runs/*/run.mcap")):  # it flies
        assert time.monotonic() < until
        assert run.poll() is None, (tmp_path / "output").read_text()
        time.sleep(0.05)
    run.kill()
    run.wait()
    until = time.monotonic() + 60.0
    while processes(tmp_path):
        assert time.monotonic() < until
        time.sleep(0.1)
    (path,) = (tmp_path / "runs").iterdir()
    for driver in ("vehicle_link", "car"):
        text = (path / "live" / f"{driver}.log").read_text()
        assert f"{driver}: aborted" in text
        assert "the supervisor is gone" in text
        assert f"{driver}: safe at the end" in text
    recording = Recording(path)
    assert recording.complete
    last = [entry.message for entry in recording.messages(["vehicle/status"])][-1]
    assert not last.armed
