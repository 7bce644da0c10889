"""The live host: one process drives a few nodes in real time, over the bus. Deadlines are absolute; late steps count.

A node that is only driven by time is stepped with its deadline as the time, however late it comes to it, so that a
simulated device keeps its rhythm; a deadline that has passed altogether is skipped and counted as missed. A node that
is woken by messages is stepped once with everything that has come, at the time that it is.
"""

from __future__ import annotations

import heapq
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hil.bus import CONTROL, HEALTH, Bus, Mailbox
from hil.host.live_presence import Presence, footprint
from hil.host.live_time import RunTime
from hil.messages import Event
from hil.node import Inbox, Node, Out
from hil.receipts import ReceiptBook

LATE_NS = 2_000_000  # a step that begins this long after its deadline is late
WIRE_PERIOD_NS = 10_000_000
_WIRE_REST_NS = 1_000_000  # a flood on a wire may not keep its driver busy
_HEALTH_NS = 500_000_000
_IDLE_NS = 100_000_000
_SAFE_LIMIT_NS = 20_000_000_000
_LINGER_NS = 2_000_000_000  # zero speed has to be sent, and an autopilot says only once a second that it is disarmed


@dataclass
class Pace:
    """How a node kept its deadlines. `late` and `missed` count steps, the rest is ns."""

    steps: int = 0
    late: int = 0
    missed: int = 0
    worst_ns: int = 0
    busy_ns: int = 0

    def note(self, lateness_ns: int, period_ns: int) -> None:
        self.late += lateness_ns > LATE_NS
        self.missed += max(0, lateness_ns) // period_ns
        self.worst_ns = max(self.worst_ns, lateness_ns)


@dataclass
class _Seat:
    """One node at its place in this process."""

    node: Node
    inbox: Inbox
    numbers: dict[str, list[int]]
    period_ns: int
    pace: Pace = field(default_factory=Pace)
    quiet_ns: int = 0  # until then its wire does not wake it again


class LiveService:
    """Drives `nodes` until told to stop. `trouble` names wires that went away; `counters` what was rejected."""

    def __init__(
        self,
        name: str,
        nodes: Sequence[Node],
        bus: Bus,
        run_time: RunTime,
        *,
        presence: Presence | None = None,
        book: ReceiptBook | None = None,
        trouble: Callable[[], list[str]] = list,
        counters: Callable[[], dict[str, int]] = dict,
        serves: str = "",
        descriptors: Mapping[int, str] | None = None,
    ) -> None:
        """`presence` watches for the supervisor; `serves` is the digest of the run that this process was built for.

        `descriptors`: of wires that wake a node, whose period then only has to be kept as far as `WIRE_PERIOD_NS`.
        """
        self.name, self._bus, self._book, self._time, self._serves = name, bus, book, run_time, serves
        self._presence = presence or Presence()
        self._trouble, self._counters = trouble, counters
        woken = set((descriptors or {}).values())
        self._seats = [
            _Seat(
                n, Inbox(n.inputs), {t: [] for t in n.inputs},
                max(n.period_ns, WIRE_PERIOD_NS if n.name in woken else 0) if n.period_ns else 0,
            )
            for n in nodes
        ]  # fmt: skip
        self._wired = {
            fd: rank for fd, name in (descriptors or {}).items() for rank, n in enumerate(nodes) if n.name == name
        }
        self._readers: dict[str, list[int]] = {}
        self._wakes: dict[str, list[int]] = {}
        for rank, node in enumerate(nodes):
            for topic in node.inputs:
                self._readers.setdefault(topic, []).append(rank)
            for topic in node.wakes:
                self._wakes.setdefault(topic, []).append(rank)
        self._mailbox = Mailbox(urgent=self._wakes)
        produced = {topic for node in nodes for topic in node.outputs}
        for node in nodes:  # what is made in this process is handed over in it
            bus.subscribe(node.name, [t for t in node.inputs if t not in produced], self._mailbox)
        bus.announce(sorted(produced))
        self._orders: list[dict[str, Any]] = []
        bus.hear(CONTROL, self._order)
        self._delayed: list[tuple[int, int, Out]] = []
        self._ticks: list[tuple[int, int]] = []
        self._serial = 0
        self._health_ns = 0
        self._stop = self._gone = False
        self._abort_ns: int | None = None
        self._safe_ns: int | None = None
        self._why = ""
        self._said: set[str] = set()

    def _order(self, table: dict[str, Any]) -> None:
        self._presence.heard()
        if table.get("order") != "watch":
            self._orders.append(table)
            self._mailbox.wake()

    def stop(self) -> None:
        """End as soon as the step under way is done (safe in a signal handler)."""
        self._stop = True
        self._mailbox.wake()

    @property
    def lost(self) -> bool:
        """Whether it ended because nobody was there any more."""
        return self._gone

    def orphaned(self) -> None:
        """The supervisor is gone: look into it at once (safe in a signal handler)."""
        self._health_ns = 0
        self._mailbox.wake()

    def wait_for_go(self) -> bool:
        """Say "ready" until the supervisor gives the run's start. False if told to stop, or if nobody is there to."""
        while not self._stop:
            self._time.tick()
            self._tell(0, "ready")
            self._mailbox.wait(_IDLE_NS)
            for order in self._take_orders():
                if order.get("order") == "go":
                    self._time.begin(int(order["epoch_ns"]))
            if self._time.begun:
                self._mailbox.drain()
                self._mailbox.lost.clear()
                return True
            if self._presence.gone():
                self._gone = True
                return False
        return False

    def run(self) -> None:
        """Step the nodes from the run's start until stopped, aborted or orphaned."""
        self._ticks = [(0, rank) for rank, seat in enumerate(self._seats) if seat.period_ns]
        heapq.heapify(self._ticks)
        while not self._stop:
            now = self._now()
            due = self._health_ns
            if self._ticks:
                due = min(due, self._ticks[0][0])
            if self._delayed:
                due = min(due, self._delayed[0][0])
            listening = []
            for fd, rank in self._wired.items():
                quiet_ns = self._seats[rank].quiet_ns
                if quiet_ns <= now:
                    listening.append(fd)
                else:
                    due = min(due, quiet_ns)
            ready = self._mailbox.wait(due - now, listening) if due > now else []
            self._turn([self._wired[fd] for fd in ready])

    def _turn(self, woken: Sequence[int] = ()) -> None:
        for order in self._take_orders():
            if order.get("order") == "abort" and self._abort_ns is None:
                self._abort(str(order.get("why", "")))
        self._read()
        for rank in woken:
            self._seats[rank].quiet_ns = self._now() + _WIRE_REST_NS
            self._step(rank, self._now())
        for _ in self._ticks:  # once each: whoever cannot keep his period still hears, and tells, in between
            if self._ticks[0][0] > self._now():
                break
            self._tick()
        while self._delayed and self._delayed[0][0] <= self._now():
            self._publish(heapq.heappop(self._delayed)[2])
        now = self._now()
        if now >= self._health_ns:
            self._health_ns = now + _HEALTH_NS
            self._look_around(now)
        if self._gone and self._safe(now):
            self._stop = True

    def _look_around(self, now_ns: int) -> None:
        self._time.tick()
        self._tell(now_ns, "aborted" if self._abort_ns is not None else "running")
        for text in self._trouble():
            self._complain(now_ns, "error", text)
        for text in self._time.remarks():
            self._complain(now_ns, "warning", text)
        gone = self._presence.gone()
        if gone and not self._gone:
            self._gone = True
            self._abort(gone)

    def _abort(self, why: str) -> None:
        """Bring every node that has something to make safe to its safe state."""
        if self._abort_ns is None:
            self._abort_ns, self._why = self._now(), why
            print(f"{self.name}: aborted at {self._abort_ns / 1e9:.3f} s: {why}", flush=True)
        for seat in self._seats:
            make_safe = getattr(seat.node, "abort", None)
            if make_safe is not None:
                make_safe(why)

    def _nodes_safe(self) -> bool:
        return all(getattr(seat.node, "safe", True) for seat in self._seats)

    def _safe(self, now_ns: int) -> bool:
        """Nothing here has to be flown on: everything has been safe for a while, or has had its time to become so."""
        if not self._nodes_safe():
            self._safe_ns = None
        elif self._safe_ns is None:
            self._safe_ns = now_ns
        settled = self._safe_ns is not None and now_ns - self._safe_ns > _LINGER_NS
        return settled or now_ns - (now_ns if self._abort_ns is None else self._abort_ns) > _SAFE_LIMIT_NS

    def _now(self) -> int:
        return self._time.now()

    def _take_orders(self) -> list[dict[str, Any]]:
        orders = []
        while self._orders:
            order = self._orders.pop(0)
            if order.get("service") not in (None, self.name):
                continue
            if order.get("order") == "stop":
                self._stop = True
            orders.append(order)
        return orders

    def _read(self) -> None:
        woken: set[int] = set()
        for letter in self._mailbox.drain():
            for rank in self._readers.get(letter.topic, ()):
                self._seats[rank].inbox.put(letter.topic, letter.message)
                self._seats[rank].numbers[letter.topic].append(letter.sequence)
            woken.update(self._wakes.get(letter.topic, ()))
        for rank in sorted(woken):
            self._step(rank, self._now())

    def _tick(self) -> None:
        due, rank = self._ticks[0]
        seat, now = self._seats[rank], self._now()
        period = seat.period_ns
        seat.pace.note(now - due, period)
        due += (now - due) // period * period
        heapq.heapreplace(self._ticks, (due + period, rank))
        self._step(rank, now if seat.node.wakes else due)

    def _step(self, rank: int, now_ns: int) -> None:
        seat = self._seats[rank]
        consumed: list[int] = []
        for topic in seat.node.inputs:
            numbers = seat.numbers[topic]
            consumed += (len(numbers), *numbers)
            numbers.clear()
        began = time.monotonic_ns()
        outs = seat.node.step(now_ns, seat.inbox)
        seat.pace.busy_ns += time.monotonic_ns() - began
        seat.pace.steps += 1
        seat.inbox.clear()
        for out in outs:
            if out.delay_ns:
                self._serial += 1
                heapq.heappush(self._delayed, (now_ns + out.delay_ns, self._serial, out))
            else:
                self._publish(out)
        if self._book is not None:  # last: nobody waits for it
            self._book.add(seat.node.name, now_ns, consumed)

    def _publish(self, out: Out) -> None:
        number = self._bus.publish(self._now(), out.topic, out.message)
        for rank in self._readers.get(out.topic, ()):
            self._seats[rank].inbox.put(out.topic, out.message)
            self._seats[rank].numbers[out.topic].append(number)
        for rank in self._wakes.get(out.topic, ()):
            self._step(rank, self._now())

    def _complain(self, now_ns: int, severity: str, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            self._bus.publish(now_ns, "event", Event(now_ns, severity, self.name, text))

    def _tell(self, now_ns: int, state: str) -> None:
        self._bus.say(HEALTH + self.name, self.health(now_ns, state))

    def health(self, now_ns: int, state: str) -> dict[str, Any]:
        """What the supervisor and `perch-hil status` are told."""
        mailbox = self._mailbox
        return {
            "service": self.name, "pid": os.getpid(), "state": state, "now_ns": now_ns,
            "outputs": sorted({t for seat in self._seats for t in seat.node.outputs}),
            "nodes": {seat.node.name: vars(seat.pace) for seat in self._seats},
            "dropped": dict(mailbox.dropped), "lost": dict(mailbox.lost), "garbage": mailbox.garbage,
            "counters": self._counters(), "safe": self._nodes_safe(), "why": self._why,
            "clock": self._time.table(), "serves": self._serves, **footprint(),
        }  # fmt: skip

    def close(self) -> None:
        """Last words, then the nodes are closed. The bus is the caller's."""
        if self._abort_ns is not None:
            print(f"{self.name}: {'safe' if self._nodes_safe() else 'NOT SAFE'} at the end", flush=True)
        self._tell(self._now() if self._time.begun else 0, "stopped")
        for seat in self._seats:
            seat.node.close()
        if self._book is not None:
            self._book.close()
        self._mailbox.close()
