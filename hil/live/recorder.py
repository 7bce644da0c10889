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
from hil.bus.mailbox import PICTURES
from hil.contract.topics import TOPICS
from hil.live.liveness import Presence, footprint
from hil.live.messages.authors import attributed
from hil.live.messages.orders import Orders
from hil.live.run_clock import RunTime
from hil.live.spec import LiveSpec
from hil.recording.disk_sync import DiskSync
from hil.recording.foxglove import FoxgloveView
from hil.recording.recorder import Recorder, RecordingError
from hil.recording.runs import write_json
from kernel.stamps import CLOCK_ERROR_NS
from vehicle.quadrotor.airframe import load_airframe

SETTLE_NS = 250_000_000  # how long a message waits for older ones
_TURN_S, _HEALTH_S = 0.02, 0.5
_PREVIEW_NS = 58_000_000  # pictures at shorter intervals do not belong to a 15 Hz preview
_MOST_WAITING = 100_000  # messages: of a flood, or before the run starts
_WITNESS_S = 22.0  # recorded after the supervisor is lost: all services have reached the safe state by then


class Sorter:
    """Deliveries in, (time, delivery) out, times never decreasing. `late` counts those that arrived too late to be
    sorted."""

    def __init__(self, settle_ns: int = SETTLE_NS) -> None:
        self._settle_ns, self._heap = settle_ns, []
        self._serial = self._written_ns = self.late = 0

    def add(self, delivery: Delivery, now_ns: int) -> None:
        """`now_ns`: the time of arrival. A publication time later than that is broken, and replaced by it."""
        self._serial += 1
        if len(self._heap) >= _MOST_WAITING:
            heapq.heappop(self._heap)
            self.late += 1
        heapq.heappush(self._heap, (min(delivery.published_ns, now_ns + CLOCK_ERROR_NS), self._serial, delivery))

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
    """Record until stopped. Raises RecordingError if that is not possible, BusError without a hub.

    A file that cannot be written any more (a full disk) ends this process only: the last health says why, and the
    supervisor ends the run in order.
    """
    assert spec.folder is not None
    plan = spec.plan()
    camera = mounted_cameras(plan.rig.camera, load_airframe(plan.rig.vehicle.airframe), spec.draw(plan))[1]
    view = FoxgloveView(camera, spec.pictures, plan.scenario.board.size)
    # not urgent, but much work: each hand-over of the interpreter costs a wait for a core on a busy machine
    sys.setswitchinterval(2e-2)
    presence, ending, published_s = Presence(), Ending(), 0.0
    period_ns = _PREVIEW_NS if spec.pictures == "preview" else 0
    mailbox = Mailbox(depth=8192, pictures=60, urgent=(), picture_period_ns=period_ns)
    sorter, seen = Sorter(), _Seen()

    def stop(_: int, __: FrameType | None) -> None:
        if not presence.orphaned_soon():  # after the parent has ended, the services still have to land
            ending.ask()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)

    def publish_health(bus: Bus, what: str, at_most_every_s: float = 0.0, why: str = "") -> bool:
        nonlocal published_s
        if time.monotonic() - published_s < at_most_every_s:
            return False
        published_s = time.monotonic()
        table = {
            "service": "recorder", "pid": os.getpid(), "host": os.uname().nodename, "session": bus.session,
            "state": what, "why": why, "late": sorter.late, "nodes": {}, "lost": dict(mailbox.lost),
            "dropped": dict(mailbox.dropped), "strangers": dict(mailbox.strangers), "garbage": mailbox.garbage,
            "counters": {"not shown": recorder.not_shown} if recorder.not_shown else {}, **footprint(),
        }  # fmt: skip
        bus.send_table(HEALTH + "recorder", table)
        return True

    with (
        Bus(spec.endpoint, spec.credentials("recorder"), timeout_s=10.0, identity="recorder") as bus,
        Recorder(spec.folder / "run.mcap", view=view) as recorder,
        DiskSync(recorder.path) as disk,
    ):
        wanted = [t for t, row in TOPICS.items() if row.recorded and (t != "camera/image" or spec.pictures != "none")]
        bus.subscribe("recorder", wanted, mailbox)
        orders = Orders("recorder", bus.session)
        bus.on_table(CONTROL, lambda table: presence.received() if orders.put(table) else None)
        run_time = RunTime(bus.clock())
        gc.collect()
        gc.freeze()  # one collection over all imported objects takes 0.1 s

        def drain() -> None:
            for delivery in mailbox.drain():
                if run_time.begun or delivery.topic != PICTURES:  # no memory is enough for all that come before
                    seen.note(delivery)
                    sorter.add(attributed(delivery), run_time.now() if run_time.begun else 0)

        try:
            while not ending.due:
                time.sleep(_TURN_S)
                for order in orders.take():
                    if order["order"] == "go":
                        run_time.begin(order["epoch_ns"])
                        zero = datetime.now(UTC) - timedelta(microseconds=run_time.now() / 1e3)
                        recorder.note("wall_clock", {"zero_utc": zero.isoformat(timespec="milliseconds")})
                    elif order["order"] == "stop" and order.get("service") == "recorder":
                        ending.ask()
                drain()
                if run_time.begun:
                    for now, delivery in sorter.take(run_time.now()):
                        recorder(now, delivery.topic, delivery.message)
                        publish_health(bus, "running", _HEALTH_S)  # else a burst looks like a recorder that has ended
                if disk.fault:
                    raise RecordingError(disk.fault)
                if publish_health(bus, "running" if run_time.begun else "ready", _HEALTH_S):
                    ending.look(bool(presence.gone()), published_s)
            drain()
            for now, delivery in sorter.take(None):
                recorder(now, delivery.topic, delivery.message)
            recorder.close()  # before the bus, whose closing takes long if the hub has ended
            write_json(spec.folder / "numbers.json", seen.table())
        except (OSError, RecordingError) as error:
            publish_health(bus, "failed", why=str(error))
            raise
        publish_health(bus, "stopped")
    return 0


class _Seen:
    """Which numbers of each topic were recorded: the first, and what is missing after it."""

    def __init__(self) -> None:
        self._first: dict[str, int] = {}
        self._next: dict[str, int] = {}
        self._missing: dict[str, list[tuple[int, int]]] = {}

    def note(self, delivery: Delivery) -> None:
        if delivery.topic == "event":  # several publishers, and no node's input
            return
        expected = self._next.get(delivery.topic, delivery.sequence)
        self._first.setdefault(delivery.topic, delivery.sequence)
        if delivery.sequence > expected:
            self._missing.setdefault(delivery.topic, []).append((expected, delivery.sequence - 1))
        self._next[delivery.topic] = delivery.sequence + 1

    def table(self) -> dict[str, Any]:
        """topic -> `first` number, and what is `missing` after it as pairs (first, last)."""
        return {
            topic: {"first": first, "missing": self._missing.get(topic, [])} for topic, first in self._first.items()
        }
