"""The recorder of a live run: when it ends, in which order it writes, and what becomes of a run on a full disk."""

import json
import os
import resource
import subprocess
import sys
import time

import pytest

from hil.assembly.rig import load_rig
from hil.bus.leaf import CONTROL, HEALTH, Bus, open_hub
from hil.bus.mailbox import Delivery
from hil.contract import messages as m
from hil.host.replay import _numbered
from hil.live import recorder as live_recorder
from hil.live.recorder import SETTLE_NS, Ending, Sorter, _Seen
from hil.live.spec import LiveSpec
from hil.live.wires import free_ports
from hil.recording.reader import Recording
from tests.unit.hil.bus.test_leaf import free_endpoint

LIMIT_S = 60.0
STILL = (0.0, 0.0, 0.0)


def test_recorder_ordered_to_end_exits_without_a_supervisor():
    ending = Ending()
    ending.look(alone=True, now_s=10.0)
    ending.ask()
    ending.look(alone=True, now_s=10.5)  # a supervisor that ends its recorder is silent by then
    assert ending.due


def test_a_recorder_without_a_supervisor_waits_for_the_safe_state():
    ending = Ending()
    ending.look(alone=False, now_s=3.0)
    ending.look(alone=True, now_s=10.0)
    ending.look(alone=True, now_s=30.0)
    assert not ending.due
    ending.look(alone=True, now_s=33.0)
    assert ending.due


def test_messages_are_written_in_the_order_of_their_publication():
    sorter = Sorter()
    for at in (30, 10, 20):
        sorter.add(Delivery("event", at, at, None), 30)
    assert sorter.take(SETTLE_NS + 5) == []
    assert [now for now, _ in sorter.take(SETTLE_NS + 20)] == [10, 20]
    sorter.add(Delivery("event", 15, 15, None), 40)  # too late for its place
    assert [now for now, _ in sorter.take(None)] == [20, 30]
    assert sorter.late == 1


def test_stamp_from_the_future_counts_as_the_time_of_arrival():
    sorter = Sorter()
    for at, now in ((2**62, 10), (20, 20)):
        sorter.add(Delivery("event", at, at, None), now)
    assert [now for now, _ in sorter.take(SETTLE_NS * 2)] == [20, 10 + live_recorder.CLOCK_ERROR_NS]


def test_messages_that_wait_are_limited(monkeypatch):
    monkeypatch.setattr(live_recorder, "_MOST_WAITING", 100)
    sorter = Sorter()
    for at in range(1000):
        sorter.add(Delivery("event", at, at, None), at)
    assert [now for now, _ in sorter.take(None)] == list(range(900, 1000))
    assert sorter.late == 900


@pytest.mark.parametrize("numbers", [[0, 1, 2], [3, 4, 9], [0, 65_535, 131_070, 131_071], [7, 9, 8, 9, 12]])
def test_missing_numbers_are_kept_as_ranges_and_restored(numbers):
    seen = _Seen()
    for number in numbers:
        seen.note(Delivery("belief", 0, number, None))
    table = json.loads(json.dumps(seen.table()))
    assert sum(map(len, table["belief"]["missing"])) <= 2 * len(numbers)

    class Recorded:
        def messages(self, _):
            return [Delivery("belief", 0, number, number) for number in numbers]

    if numbers == sorted(numbers):
        assert list(_numbered(Recorded(), "belief", table)) == [(number, number) for number in numbers]
    old = {"belief": {"first": 3, "missing": [5, 6, 7, 8]}}
    found = list(_numbered(Recorded(), "belief", old))
    assert [number for number, _ in found][:3] == [3, 4, 9]


class Process:
    """The recorder's process in a folder, on a bus of its own, with room for `room` bytes a file."""

    def __init__(self, folder, room):
        (folder / "live").mkdir()
        self.endpoint = free_endpoint()
        spec = LiveSpec(
            scenario="simple-i", rig="sim", policy=None, camera="model", seed=0, endpoint=self.endpoint,
            ports=free_ports(load_rig("sim")), pictures="none", folder=folder,
        )  # fmt: skip
        spec.write(folder / "live" / "spec.json")
        self.command = [sys.executable, "-m", "hil.live.main", str(folder / "live" / "spec.json"), "recorder"]
        self.log, self.room = folder / "live" / "recorder.log", room

    def limit(self):
        resource.setrlimit(resource.RLIMIT_FSIZE, (self.room, resource.RLIM_INFINITY))

    def start(self):
        with self.log.open("wb") as log:
            return subprocess.Popen(self.command, stdout=log, stderr=log, preexec_fn=self.limit)


@pytest.mark.parametrize("room", [120_000, 2**30])
def test_recorder_on_a_full_disk_states_the_cause_and_exits(tmp_path, room):
    process, health = Process(tmp_path, room), []
    with open_hub(process.endpoint), Bus(process.endpoint, identity="supervisor") as bus:
        bus.on_table(HEALTH + "recorder", health.append)
        child, until = process.start(), time.monotonic() + LIMIT_S
        state = VehicleStates(bus)
        ended_s = None
        while child.poll() is None:
            assert time.monotonic() < until
            if not any(table["state"] == "ready" for table in health):
                time.sleep(0.05)
                continue
            state.publish()
            if room > 2**20 and ended_s is None and state.count > 1000:
                ended_s = time.monotonic()
            bus.send_table(CONTROL, {"order": "go", "epoch_ns": state.epoch_ns})
            if ended_s is not None:
                bus.send_table(CONTROL, {"order": "stop", "service": "recorder"})
        until = time.monotonic() + 5.0
        while health[-1]["state"] not in ("failed", "stopped") and time.monotonic() < until:
            time.sleep(0.05)
    recording = Recording(tmp_path / "run.mcap")
    assert len(list(recording.messages(["truth/vehicle"]))) > 100
    if room > 2**20:
        assert (child.returncode, health[-1]["state"], recording.complete) == (0, "stopped", True)
        return
    assert child.returncode == 3
    assert health[-1]["state"] == "failed"
    assert "run.mcap failed" in health[-1]["why"]
    assert health[-1]["why"].endswith("File too large")
    lines = process.log.read_text().splitlines()
    assert lines == [f"perch-hil: recorder: {health[-1]['why']}"]


class VehicleStates:
    """Publishes poses that do not compress."""

    def __init__(self, bus):
        self.bus, self.count, self.epoch_ns = bus, 0, time.monotonic_ns()

    def publish(self):
        for _ in range(20):
            now_ns = time.monotonic_ns() - self.epoch_ns
            place = tuple(float(byte) / 7 for byte in os.urandom(3))
            state = m.VehicleState(now_ns, place, STILL, (1.0, 0.0, 0.0, 0.0), STILL)
            self.bus.publish(now_ns, "truth/vehicle", state)
            self.count += 1
        time.sleep(0.02)
