"""The recorder's process: writes every message of the contract from the bus into run.mcap, sorted by publication time.

A message waits `SETTLE_NS` for older ones; one that arrives later gets the time of the last written message.
"""

from __future__ import annotations

import gc
import heapq
import os
import signal
import sys
import time
from datetime import UTC, datetime, timedelta
from types import FrameType
from typing import Any

from hil.assembly.sensing import mounted_cameras
from hil.bus.leaf import CONTROL, HEALTH, Bus, Delivery, Mailbox
from hil.contract.topics import TOPICS
from hil.live.liveness import Presence, footprint
from hil.live.run_clock import RunTime
from hil.live.spec import LiveSpec
from hil.recording.foxglove import FoxgloveView
from hil.recording.recorder import Recorder
from hil.recording.runs import write_json
from vehicle.quadrotor.airframe import load_airframe

SETTLE_NS = 250_000_000  # how long a message waits for older ones
_TURN_S, _HEALTH_S = 0.02, 0.5
_PREVIEW_NS = 58_000_000  # pictures at shorter intervals do not belong to a 15 Hz preview
_WITNESS_S = 22.0  # recorded after the supervisor is lost: all services have reached the safe state by then


class Sorter:
    """Deliveries in, (time, delivery) out, times never decreasing. `late` counts those that arrived too late to be
    sorted."""

    def __init__(self, settle_ns: int = SETTLE_NS) -> None:
        self._settle_ns, self._heap = settle_ns, []
        self._serial = self._written_ns = self.late = 0

    def add(self, delivery: Delivery) -> None:
        self._serial += 1
        heapq.heappush(self._heap, (delivery.published_ns, self._serial, delivery))

    def take(self, now_ns: int | None) -> list[tuple[int, Delivery]]:
        """What has waited long enough at `now_ns`; everything for None."""
        ready = []
        while self._heap and (now_ns is None or self._heap[0][0] <= now_ns - self._settle_ns):
            published_ns, _, delivery = heapq.heappop(self._heap)
            if published_ns < self._written_ns:
                self.late += 1
            self._written_ns = max(self._written_ns, published_ns)
            ready.append((self._written_ns, delivery))
        return ready


class Ending:
    """When to end: on request, or after the supervisor is lost, late enough that the safe state is recorded."""

    def __init__(self) -> None:
        self.due, self._alone_s = False, 0.0

    def ask(self) -> None:
        """End (safe in a signal handler). It cannot be withdrawn."""
        self.due = True

    def look(self, alone: bool, now_s: float) -> None:
        """Note whether the supervisor, which orders the end, is lost (`alone`) at `now_s`."""
        if alone:
            self._alone_s = self._alone_s or now_s
            self.due = self.due or now_s - self._alone_s > _WITNESS_S


def record(spec: LiveSpec) -> int:
    """Record until stopped. Raises RecordingError if that is not possible, BusError without a hub."""
    assert spec.folder is not None
    plan = spec.plan()
    camera = mounted_cameras(plan.rig.camera, load_airframe(plan.rig.vehicle.airframe), spec.draw(plan))[1]
    view = FoxgloveView(camera, spec.pictures, plan.scenario.board.size)
    # not urgent, but much work: each hand-over of the interpreter costs a wait for a core on a busy machine
    sys.setswitchinterval(2e-2)
    state, presence, ending = {"orders": [], "published_s": 0.0}, Presence(), Ending()
    period_ns = _PREVIEW_NS if spec.pictures == "preview" else 0
    mailbox = Mailbox(depth=8192, pictures=60, urgent=(), picture_period_ns=period_ns)
    sorter, seen = Sorter(), _Seen()

    def stop(_: int, __: FrameType | None) -> None:
        if not presence.orphaned_soon():  # after the parent has ended, the services still have to land
            ending.ask()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)

    def take(order: dict[str, Any]) -> None:
        presence.received()
        state["orders"].append(order)

    def publish_health(bus: Bus, what: str, at_most_every_s: float = 0.0) -> bool:
        if time.monotonic() - state["published_s"] < at_most_every_s:
            return False
        state["published_s"] = time.monotonic()
        table = {"service": "recorder", "pid": os.getpid(), "state": what, "late": sorter.late, "nodes": {}}
        table |= {"lost": dict(mailbox.lost), "dropped": dict(mailbox.dropped), **footprint()}
        bus.send_table(HEALTH + "recorder", table)
        return True

    with (
        Recorder(spec.folder / "run.mcap", view=view) as recorder,
        Bus(spec.endpoint, spec.credentials("recorder"), timeout_s=10.0) as bus,
    ):
        wanted = [t for t, row in TOPICS.items() if row.recorded and (t != "camera/image" or spec.pictures != "none")]
        bus.subscribe("recorder", wanted, mailbox)
        bus.on_table(CONTROL, take)
        run_time = RunTime(bus.clock())
        gc.collect()
        gc.freeze()  # one collection over all imported objects takes 0.1 s
        while not ending.due:
            time.sleep(_TURN_S)
            for order in _orders(state["orders"]):
                if order.get("order") == "go":
                    run_time.begin(int(order["epoch_ns"]))
                    zero = datetime.now(UTC) - timedelta(microseconds=run_time.now() / 1e3)
                    recorder.note("wall_clock", {"zero_utc": zero.isoformat(timespec="milliseconds")})
                elif order.get("order") == "stop" and order.get("service") == "recorder":
                    ending.ask()
            for delivery in mailbox.drain():
                seen.note(delivery)
                sorter.add(delivery)
            if run_time.begun:
                for now, delivery in sorter.take(run_time.now()):
                    recorder(now, delivery.topic, delivery.message)
                    publish_health(bus, "running", _HEALTH_S)  # else a burst looks like a recorder that has ended
            if publish_health(bus, "running" if run_time.begun else "ready", _HEALTH_S):
                ending.look(bool(presence.gone()), state["published_s"])
        for delivery in mailbox.drain():
            seen.note(delivery)
            sorter.add(delivery)
        for now, delivery in sorter.take(None):
            recorder(now, delivery.topic, delivery.message)
        recorder.close()  # before the bus, whose closing takes long if the hub has ended
        write_json(spec.folder / "numbers.json", seen.table())
        publish_health(bus, "stopped")
    return 0


class _Seen:
    """Which numbers of each topic were recorded: the first, and what is missing after it."""

    def __init__(self) -> None:
        self._first: dict[str, int] = {}
        self._next: dict[str, int] = {}
        self._missing: dict[str, list[int]] = {}

    def note(self, delivery: Delivery) -> None:
        if delivery.topic == "event":  # several publishers, and no node's input
            return
        if delivery.topic not in self._first:
            self._first[delivery.topic] = delivery.sequence
        else:
            self._missing.setdefault(delivery.topic, []).extend(range(self._next[delivery.topic], delivery.sequence))
        self._next[delivery.topic] = delivery.sequence + 1

    def table(self) -> dict[str, Any]:
        return {
            topic: {"first": first, "missing": self._missing.get(topic, [])} for topic, first in self._first.items()
        }


def _orders(waiting: list[dict[str, Any]]) -> list[dict[str, Any]]:
    taken = waiting[:]
    del waiting[: len(taken)]
    return taken
