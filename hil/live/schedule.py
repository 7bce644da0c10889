"""The schedule of one process: which messages have arrived for each node, when it is due, and where its output goes.

A node that is only driven by time is stepped with its deadline as the time, however late the step begins, so that a
simulated device keeps its period; a deadline that the next one has overtaken is skipped and counted as missed. A node
that is woken by messages is stepped once with everything that has arrived, at the current time.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

from hil.bus.mailbox import Delivery
from hil.contract.codec import CodecError
from hil.contract.node import Inbox, Node, Out, routes
from hil.recording.receipts import ReceiptBook
from hil.recording.recorder import RecordingError

LATE_NS = 2_000_000  # a step that begins this long after its deadline is late
WIRE_PERIOD_NS = 10_000_000


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
class _ScheduledNode:
    """One node, what has arrived for it, and how it keeps its deadlines. `numbers`: topic -> those of new messages."""

    node: Node
    inbox: Inbox
    numbers: dict[str, list[int]]
    period_ns: int
    pace: Pace = field(default_factory=Pace)


class Schedule:
    """Steps `nodes`. `publish(topic, message)` hands it to the bus and returns its number; `now()`: the run's ns."""

    def __init__(
        self,
        nodes: Sequence[Node],
        publish: Callable[[str, Any], int],
        now: Callable[[], int],
        *,
        book: ReceiptBook | None = None,
        wired: Collection[str] = (),
        step_priority: AbstractContextManager[None] | None = None,
    ) -> None:
        """`wired`: nodes woken by a wire, whose period then only has to be kept as far as `WIRE_PERIOD_NS`.
        `step_priority` is entered for every step."""
        self._bus_publish, self._now, self._book = publish, now, book
        self._step_priority = step_priority or nullcontext()
        self._scheduled = [
            _ScheduledNode(
                n, Inbox(n.inputs), {t: [] for t in n.inputs},
                max(n.period_ns, WIRE_PERIOD_NS if n.name in wired else 0) if n.period_ns else 0,
            )
            for n in nodes
        ]  # fmt: skip
        self._readers, self._wakes = routes(nodes)
        self._delayed: list[tuple[int, int, Out]] = []
        self._ticks: list[tuple[int, int]] = []
        self._serial = 0
        self.receipts_lost = self.unpublished = ""  # the first cause of each

    @property
    def nodes(self) -> list[Node]:
        return [one.node for one in self._scheduled]

    @property
    def urgent(self) -> Collection[str]:
        """Topics that wake a node."""
        return self._wakes

    @property
    def paces(self) -> Iterator[tuple[str, Pace]]:
        return ((one.node.name, one.pace) for one in self._scheduled)

    def begin(self, first_ns: int = 0) -> None:
        """The run's time starts at 0, the deadlines at `first_ns`."""
        self._ticks = [(first_ns, rank) for rank, one in enumerate(self._scheduled) if one.period_ns]
        heapq.heapify(self._ticks)

    def due_ns(self, latest_ns: int) -> int:
        """When the next node is due or the next delayed message is to be published (ns), at the latest `latest_ns`."""
        if self._ticks:
            latest_ns = min(latest_ns, self._ticks[0][0])
        return min(latest_ns, self._delayed[0][0]) if self._delayed else latest_ns

    def receive(self, deliveries: Iterable[Delivery]) -> None:
        """Distribute `deliveries`, then step the nodes that they wake."""
        woken: set[int] = set()
        for delivery in deliveries:
            self._put(delivery.topic, delivery.message, delivery.sequence)
            woken.update(self._wakes.get(delivery.topic, ()))
        for rank in sorted(woken):
            self.step(rank, self._now())

    def catch_up(self) -> None:
        """Step the nodes whose deadline has come, publish the messages whose delay is over."""
        for _ in self._ticks:  # once each: a node that cannot keep its period still receives and publishes in between
            self._publish_delayed()  # first: a picture may not wait until the next one is drawn
            if self._ticks[0][0] > self._now():
                return
            self._tick()
        self._publish_delayed()

    def _publish_delayed(self) -> None:
        while self._delayed and self._delayed[0][0] <= self._now():
            self._publish(heapq.heappop(self._delayed)[2])

    def _tick(self) -> None:
        due, rank = self._ticks[0]
        one, now = self._scheduled[rank], self._now()
        period = one.period_ns
        one.pace.note(now - due, period)
        due += (now - due) // period * period
        heapq.heapreplace(self._ticks, (due + period, rank))
        self.step(rank, now if one.node.wakes else due)

    def step(self, rank: int, now_ns: int) -> None:
        """Step one node with the messages that have arrived for it."""
        one = self._scheduled[rank]
        consumed: list[int] = []
        for topic in one.node.inputs:
            numbers = one.numbers[topic]
            consumed += (len(numbers), *numbers)
            numbers.clear()
        began = time.monotonic_ns()
        with self._step_priority:
            outs = one.node.step(now_ns, one.inbox)
        one.pace.busy_ns += time.monotonic_ns() - began
        one.pace.steps += 1
        one.inbox.clear()
        for out in outs:
            if out.delay_ns:
                self._serial += 1
                heapq.heappush(self._delayed, (now_ns + out.delay_ns, self._serial, out))
            else:
                self._publish(out)
        self._add_receipt(one.node.name, now_ns, consumed)  # last: no node waits for it

    def _add_receipt(self, node: str, now_ns: int, consumed: list[int]) -> None:
        """Nodes are stepped on when receipts cannot be written: `receipts_lost` then holds the cause."""
        if self._book is None or self.receipts_lost:
            return
        try:
            self._book.add(node, now_ns, consumed)
        except (RecordingError, CodecError) as error:
            self.receipts_lost = str(error)

    def _publish(self, out: Out) -> None:
        try:
            number = self._bus_publish(out.topic, out.message)
        except CodecError as error:  # a lost message; its node, which may drive a device, is stepped on
            self.unpublished = self.unpublished or f"a message could not be published: {error}"
            return
        self._put(out.topic, out.message, number)
        for rank in self._wakes.get(out.topic, ()):
            self.step(rank, self._now())

    def _put(self, topic: str, message: Any, number: int) -> None:
        for rank in self._readers.get(topic, ()):
            self._scheduled[rank].inbox.put(topic, message)
            self._scheduled[rank].numbers[topic].append(number)

    def close(self) -> None:
        """Close every node and the book."""
        for one in self._scheduled:
            one.node.close()
        if self._book is not None:
            try:
                self._book.close()
            except RecordingError as error:
                self.receipts_lost = self.receipts_lost or str(error)
