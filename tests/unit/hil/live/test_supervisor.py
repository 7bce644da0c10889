"""The supervisor: an ended service is reported with its last log line, no process and no shared memory is orphaned."""

import mmap
import os
import re
import signal
import subprocess
import sys
import time

import pytest

from hil.live import orphaned
from hil.live.orphaned import mapped_memory, remove_orphaned_memory
from hil.live.process import Process
from hil.live.supervisor import Supervisor, SupervisorError
from hil.scoring.score import ABORTED
from vehicle.px4.driver.arming import Arming, Identity


def process(tmp_path, code):
    return Process("brain", [sys.executable, "-c", code], tmp_path / "brain.log")


def wait_for(condition, limit_s=10.0):
    until = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def test_an_exit_is_reported_with_the_last_line_of_the_log(tmp_path):
    one = process(tmp_path, "import sys; print('perch-hil: no camera'); sys.exit(3)")
    wait_for(lambda: one.ended() is not None)
    assert one.why() == "brain ended with exit code 3: no camera"


def test_a_kill_is_reported_with_its_signal(tmp_path):
    one = process(tmp_path, "import time; time.sleep(60)")
    os.kill(one.pid, signal.SIGKILL)
    wait_for(lambda: one.ended() is not None)
    assert one.why() == "brain was killed by SIGKILL"


def test_a_process_that_ignores_sigterm_is_killed(tmp_path):
    ready = tmp_path / "ready"
    code = f"import signal, time, pathlib; signal.signal(15, signal.SIG_IGN); pathlib.Path({str(ready)!r}).touch()\n"
    one = process(tmp_path, code + "while True: time.sleep(1)")
    wait_for(ready.exists)
    assert one.end(0.1) == "brain had to be stopped with SIGKILL"
    assert one.ended() == -signal.SIGKILL


def test_a_stopped_process_is_killed_too(tmp_path):
    one = process(tmp_path, "import time; time.sleep(60)")
    os.kill(one.pid, signal.SIGSTOP)
    assert one.end(0.1) == "brain had to be stopped with SIGKILL"


def test_supervisor_keeps_publishing_while_waiting_for_a_process_to_end(tmp_path):
    beats = []
    one = process(tmp_path, "import time; time.sleep(60)")
    assert one.end(0.5, lambda: beats.append(1)) == "brain had to be stopped with SIGTERM"
    assert len(beats) >= 3


def test_stopped_process_is_recognised_as_stopped(tmp_path):
    one = process(tmp_path, "import time; time.sleep(60)")
    assert not one.stopped()
    os.kill(one.pid, signal.SIGSTOP)
    wait_for(one.stopped)
    one.end(0.0)


def process_without_main_thread(tmp_path):
    """A process whose main thread has exited with status 7 (exit of x86-64 and arm64) while another thread runs on."""
    code = "import ctypes, platform, threading, time\nthreading.Thread(target=time.sleep, args=(60,)).start()\n"
    one = process(tmp_path, code + "ctypes.CDLL(None).syscall(60 if platform.machine() == 'x86_64' else 93, 7)")
    wait_for(lambda: one.leaving() is not None)
    return one


def test_process_counts_as_ending_once_its_main_thread_has_ended(tmp_path):
    one = process_without_main_thread(tmp_path)
    assert one.ended() is None
    assert one.why() == "brain ended with exit code 7"
    one.end(0.0)
    assert one.leaving() == one.ended() == -signal.SIGTERM


class Run:
    """A supervisor in the middle of a run without services: what it received, and when, is set by hand."""

    def __init__(self, tmp_path, **ages_s):
        self.supervisor = Supervisor(tmp_path / "spec.json", "tcp/127.0.0.1:1", tmp_path, tuple(ages_s))
        self.supervisor._started_ns = 1
        self.now_ns = time.monotonic_ns()
        for service, age_s in ages_s.items():
            outputs = {"brain": ["belief"], "mocap": ["mocap/board"]}.get(service, [])
            self.supervisor.health[service] = {"received_ns": self.now_ns - int(age_s * 1e9), "outputs": outputs}

    def topic(self, topic, age_s):
        self.supervisor._received[topic] = self.now_ns - int(age_s * 1e9)

    def trouble(self):
        return self.supervisor.trouble()


def test_no_fault_while_all_services_publish(tmp_path):
    run = Run(tmp_path, brain=0.4, mocap=0.3)
    run.topic("belief", 0.5)
    assert run.trouble() == ""


def test_a_topic_that_is_not_published_is_reported_with_its_publisher(tmp_path):
    run = Run(tmp_path, brain=0.2, mocap=0.3)
    run.topic("mocap/board", 1.2)
    assert run.trouble().startswith("mocap has not published mocap/board for 1.2")


def test_service_without_health_is_reported_before_the_services_that_wait_for_it(tmp_path):
    run = Run(tmp_path, brain=0.2, camera=1.3, mocap=0.3)
    run.topic("belief", 1.1)
    assert run.trouble().startswith("camera does not answer: no health for 1.3")


def test_all_services_without_health_are_reported_the_longest_first(tmp_path):
    """One that hangs on a busy core keeps others from answering."""
    run = Run(tmp_path, brain=0.2, camera=1.1, detector=1.3, mocap=0.3)
    run.topic("belief", 1.1)
    named = "detector does not answer: no health for 1.3 s; camera does not answer: no health for 1.1 s"
    assert run.trouble().startswith(named)


def test_services_are_judged_a_moment_after_the_computer_has_stood_still_once_in_three_seconds(tmp_path, monkeypatch):
    run, begun, later_s = Run(tmp_path, brain=1.2, mocap=1.2), time.monotonic_ns(), 0.0
    run.topic("belief", 1.2)
    monkeypatch.setattr("hil.live.supervisor.time.monotonic_ns", lambda: begun + int(later_s * 1e9))
    found = []
    for step in range(50):
        later_s = 0.1 * step
        run.supervisor.stood_still()
        found.append(bool(run.trouble()))
    assert found == [step in range(6, 31) or step >= 37 for step in range(50)]


def test_service_without_topics_is_supervised_by_its_health(tmp_path):
    assert Run(tmp_path, brain=0.2, mocap=2.2).trouble().startswith("mocap does not answer")
    assert Run(tmp_path, brain=0.2, mocap=1.5).trouble() == ""


def test_recorder_has_a_longer_limit_and_is_not_reported_for_other_services(tmp_path):
    run = Run(tmp_path, brain=0.2, recorder=1.8, mocap=0.3)
    assert run.trouble() == ""
    run.topic("mocap/board", 1.2)
    assert run.trouble().startswith("mocap has not published")
    assert Run(tmp_path, brain=0.2, mocap=0.2, recorder=2.1).trouble().startswith("recorder does not answer")


def test_hub_is_reported_when_no_service_is_received(tmp_path):
    run = Run(tmp_path, brain=1.2, mocap=1.4)
    run.topic("belief", 1.1)
    assert run.trouble().startswith("hub does not answer: no service was received for 1.2")


def test_a_service_that_does_not_publish_because_it_ends_is_reported_as_ended(tmp_path):
    run = Run(tmp_path, brain=1.2, mocap=0.3)
    run.topic("belief", 1.1)
    run.supervisor._processes["brain"] = one = process(tmp_path, "import time; time.sleep(60)")
    assert run.trouble().startswith("brain does not answer")
    one.end(0.0)
    run.supervisor._processes["brain"] = one = process_without_main_thread(tmp_path)
    assert run.trouble() == "brain ended with exit code 7"
    one.end(0.0)


OURS = {"scenario": "s", "rig": "r", "seed": "3", "policy file": "e5c5" * 16, "code": "c0de" * 16}
OLD_CLOCK = {"shared": False, "error_ns": 9_000_000}


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({}, r"brain was started for another run .another scenario, rig, seed.: give `perch-hil bus node` the same"),
        ({"serves": "of an older version"}, "brain was started for another run"),
        ({"serves": {**OURS, "seed": "4"}}, r"brain was started for another run .another seed."),
        (
            {"serves": {**OURS, "policy file": "d887" * 16}},
            r"brain has another policy file on its host .d887d887d887. than this run .e5c5e5c5e5c5.: copy this run's",
        ),
        (
            {"serves": {**OURS, "code": "0" * 64}},
            r"brain has another code on its host .000000000000. than this run .c0dec0dec0de.: install the same version",
        ),
        (
            {"serves": OURS, "clock": OLD_CLOCK},
            "brain: its host's clock can be compared with the hub's only to within 9.0 ms, allowed are 5",
        ),
    ],
)
def test_a_service_of_another_host_that_does_not_fit_is_refused(tmp_path, table, text):
    supervisor = Supervisor(tmp_path / "spec.json", "tcp/127.0.0.1:1", tmp_path, ("brain",), OURS)
    supervisor.health["brain"] = {"state": "ready", **table}
    with pytest.raises(SupervisorError, match=text) as error:
        supervisor.wait_ready(["brain"], waiting=lambda _: None)
    assert "\n" not in str(error.value)


def test_a_service_of_this_host_that_has_read_a_changed_file_is_refused(tmp_path):
    supervisor = Supervisor(tmp_path / "spec.json", "tcp/127.0.0.1:1", tmp_path, (), OURS)
    supervisor.health |= {"brain": {"state": "ready", "serves": OURS}, "recorder": {"state": "ready"}}
    supervisor.wait_ready(["brain", "recorder"], waiting=lambda _: None)
    supervisor.health["brain"]["serves"] = {**OURS, "policy file": "d887" * 16}
    with pytest.raises(SupervisorError, match="brain has read another policy file than this run: changed meanwhile"):
        supervisor.wait_ready(["brain"], waiting=lambda _: None)


def test_hub_that_cannot_start_is_reported_by_name(tmp_path):
    spec = tmp_path / "spec.json"
    spec.write_text("{}")
    with Supervisor(spec, "tcp/127.0.0.1:1", tmp_path) as supervisor:
        supervisor.start("hub")
        with pytest.raises(SupervisorError, match=r"hub ended with exit code .*spec"):
            supervisor.connect(limit_s=60.0)


def test_orphaned_shared_memory_of_the_bus_is_removed_and_held_is_kept(tmp_path, monkeypatch):
    folder = tmp_path / "shm"  # not /dev/shm: each process that joins a bus, of any other test, cleans up there
    folder.mkdir()
    monkeypatch.setattr(orphaned, "_FOLDER", folder)
    monkeypatch.setattr(orphaned, "_MAPPED", re.compile(rf" {folder}/(\S+\.zenoh)$", re.MULTILINE))
    orphan, held = folder / "1.zenoh", folder / "2.zenoh"
    outside = tmp_path / "outside.zenoh"
    holder = None
    try:
        for path in (orphan, held):
            path.write_bytes(bytes(4096))
        code = (
            "import mmap, sys, time; f = open(sys.argv[1], 'r+b'); m = mmap.mmap(f.fileno(), 4096); print(flush=True)\n"
        )
        holder = subprocess.Popen(
            [sys.executable, "-c", code + "time.sleep(60)", str(held)], stdout=subprocess.PIPE, text=True
        )
        assert holder.stdout is not None
        holder.stdout.readline()
        assert mapped_memory(holder.pid) == {held.name}
        outside.write_bytes(b"not of the bus")
        with orphan.open("r+b") as file, mmap.mmap(file.fileno(), 4096) as mapped:  # by the process that removes it
            assert mapped_memory() >= {orphan.name}
            removed = remove_orphaned_memory([orphan.name])
            assert len(mapped) == 4096
        assert removed == [orphan.name]
        orphan.write_bytes(bytes(4096))
        paths = [f"../..{outside}", str(outside), "../shm/" + held.name]
        assert remove_orphaned_memory([*paths, orphan.name, held.name, "gone.zenoh"]) == [orphan.name]
        assert held.exists()
        assert outside.exists(), "a path in a health leads nowhere"
        assert not orphan.exists()
    finally:
        if holder is not None:
            holder.kill()
            holder.communicate()


class FakeBus:
    """Keeps what is published and ordered."""

    session = "s"

    def __init__(self):
        self.published, self.orders = [], []

    def publish(self, now_ns, topic, message):
        self.published.append((topic, message))

    def send_table(self, key, table):
        self.orders.append(table)

    def close(self):
        pass


def test_order_to_start_says_what_may_be_armed_and_an_abort_stands_in_the_recording(tmp_path):
    one = Supervisor(tmp_path / "spec.json", "", tmp_path)
    one._bus = bus = FakeBus()
    one.abort("before the start")
    assert bus.published == [], "there is no run's time yet"
    arming = Arming(Identity("4954", ""), {"COM_OF_LOSS_T": 0.3})
    one.go(arming=arming)
    assert Arming.of(bus.orders[-1]["arming"]) == arming
    one.abort("brain was killed")
    ((topic, event),) = bus.published
    assert (topic, event.source, event.text) == ("event", "supervisor", f"{ABORTED}brain was killed")
    assert bus.orders[-1] == {"order": "abort", "why": "brain was killed", "session": "s"}
