"""The nodes of one process, each at its seat: what has come for it, when it is due, and where goes what it says.

A node that is only driven by time is stepped with its deadline as the time, however late it comes to it, so that a
simulated device keeps its rhythm; a deadline that has passed altogether is skipped and counted as missed. A node that
is woken by messages is stepped once with everything that has come, at the time that it is.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

from hil.bus.mailbox import Letter
from hil.contract.node import Inbox, Node, Out, routes
from hil.recording.receipts import ReceiptBook

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
class _Seat:
    """One node at its place in this process."""

    node: Node
    inbox: Inbox
    numbers: dict[str, list[int]]
    period_ns: int
    pace: Pace = field(default_factory=Pace)


class Seats:
    """Steps `nodes`. `publish(topic, message)` gives it to the bus and returns its number; `now()` is the run's ns."""

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
        self._seats = [
            _Seat(
                n, Inbox(n.inputs), {t: [] for t in n.inputs},
                max(n.period_ns, WIRE_PERIOD_NS if n.name in wired else 0) if n.period_ns else 0,
            )
            for n in nodes
        ]  # fmt: skip
        self._readers, self._wakes = routes(nodes)
        self._delayed: list[tuple[int, int, Out]] = []
        self._ticks: list[tuple[int, int]] = []
        self._serial = 0

    @property
    def nodes(self) -> list[Node]:
        return [seat.node for seat in self._seats]

    @property
    def urgent(self) -> Collection[str]:
        """Topics that wake a node."""
        return self._wakes

    @property
    def paces(self) -> Iterator[tuple[str, Pace]]:
        return ((seat.node.name, seat.pace) for seat in self._seats)

    def begin(self, first_ns: int = 0) -> None:
        """The run's time starts at 0, the deadlines at `first_ns`."""
        self._ticks = [(first_ns, rank) for rank, seat in enumerate(self._seats) if seat.period_ns]
        heapq.heapify(self._ticks)

    def due_ns(self, latest_ns: int) -> int:
        """When something has to be done, at the latest at `latest_ns`."""
        if self._ticks:
            latest_ns = min(latest_ns, self._ticks[0][0])
        return min(latest_ns, self._delayed[0][0]) if self._delayed else latest_ns

    def receive(self, letters: Iterable[Letter]) -> None:
        """Hand out letters, then step whom they wake."""
        woken: set[int] = set()
        for letter in letters:
            self._put(letter.topic, letter.message, letter.sequence)
            woken.update(self._wakes.get(letter.topic, ()))
        for rank in sorted(woken):
            self.step(rank, self._now())

    def catch_up(self) -> None:
        """Step whose deadline has come, publish what has been delayed until now."""
        for _ in self._ticks:  # once each: whoever cannot keep his period still hears, and tells, in between
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
        seat, now = self._seats[rank], self._now()
        period = seat.period_ns
        seat.pace.note(now - due, period)
        due += (now - due) // period * period
        heapq.heapreplace(self._ticks, (due + period, rank))
        self.step(rank, now if seat.node.wakes else due)

    def step(self, rank: int, now_ns: int) -> None:
        """Step one node with what has come for it."""
        seat = self._seats[rank]
        consumed: list[int] = []
        for topic in seat.node.inputs:
            numbers = seat.numbers[topic]
            consumed += (len(numbers), *numbers)
            numbers.clear()
        began = time.monotonic_ns()
        with self._step_priority:
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
        self._put(out.topic, out.message, self._bus_publish(out.topic, out.message))
        for rank in self._wakes.get(out.topic, ()):
            self.step(rank, self._now())

    def _put(self, topic: str, message: Any, number: int) -> None:
        for rank in self._readers.get(topic, ()):
            self._seats[rank].inbox.put(topic, message)
            self._seats[rank].numbers[topic].append(number)

    def close(self) -> None:
        """Close every node and the book."""
        for seat in self._seats:
            seat.node.close()
        if self._book is not None:
            self._book.close()
