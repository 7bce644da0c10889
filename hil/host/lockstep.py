"""The lockstep host: virtual time, deterministic, as fast as the machine allows.

A queue ordered by (time, rank) holds the nodes' ticks and the messages' arrivals. Equal times follow the graph's order,
so that two runs of one seed give the same bytes. Where a second thread is allowed, the steps of nodes with a lookahead
are computed on it while the others step, and are waited for when their lookahead has passed: what is published, and in
which order, stays the same.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

from hil.contract.node import Inbox, Node, Out, routes
from hil.recording.receipts import Counted, ReceiptBook

Tap = Callable[[int, str, Any], None]


class Clock:
    """The run's virtual time, readable by memory wires."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        return self.now_ns


class _UnderWay(NamedTuple):
    """A step that began at `begun_ns` and is computed on the second thread."""

    begun_ns: int
    outs: Future[list[Out]]


class Lockstep:
    """Drives `nodes` in virtual time; `tap(now_ns, topic, message)` receives every message as it is published."""

    def __init__(
        self, nodes: Sequence[Node], clock: Clock, tap: Tap, *, book: ReceiptBook | None = None, threads: int = 1
    ) -> None:
        """`book` receives every step's receipt. `threads`: more than one allow the second thread."""
        self._nodes, self._clock, self._tap = nodes, clock, tap
        self._inboxes = [Inbox(node.inputs) for node in nodes]
        self._receipts = [Counted(node, book) for node in nodes] if book is not None else []
        self._readers, self._wakes = routes(nodes)
        # Queue entries: (time, rank, serial, index, what): None is a tick of node `rank`, an `_UnderWay` stands where
        # the first of its messages could. A message's rank is that of its publisher, so it reaches readers before any
        # later node of the same instant steps; the messages of a step under way share its serial.
        self._queue: list[tuple[int, int, int, int, Out | _UnderWay | None]] = []
        self._serial = 0
        self._two_threads = threads > 1 and any(node.lookahead_ns for node in nodes)
        self._second: ThreadPoolExecutor | None = None  # while it runs on two threads
        for rank, node in enumerate(nodes):
            if node.period_ns:
                self._push(0, rank, None)

    def _push(self, time_ns: int, rank: int, what: Out | _UnderWay | None) -> None:
        heapq.heappush(self._queue, (time_ns, rank, self._serial, 0, what))
        self._serial += 1

    def run(self, until: Callable[[int], bool]) -> int:
        """Run until `until(now_ns)` is true, checked once per instant; returns the virtual time reached (ns).

        Raises what a node's step raises.
        """
        if not self._two_threads:
            return self._run(until)
        with ThreadPoolExecutor(1, "lockstep") as self._second:
            reached_ns = self._run(until)
            for *_, what in self._queue:
                if isinstance(what, _UnderWay):
                    what.outs.result()  # raises what the step raised
            return reached_ns

    def _run(self, until: Callable[[int], bool]) -> int:
        queue, clock, nodes = self._queue, self._clock, self._nodes
        while queue:
            time_ns, rank, _, _, what = queue[0]
            if isinstance(what, _UnderWay):
                self._join()
                continue
            if time_ns != clock.now_ns and until(clock.now_ns):
                break
            clock.now_ns = time_ns
            heapq.heappop(queue)
            if what is None:
                self._step(rank)
                self._push(time_ns + nodes[rank].period_ns, rank, None)
            else:
                self._publish(what.topic, what.message)
                for reader in self._wakes.get(what.topic, ()):
                    self._step(reader)
        return clock.now_ns

    def _step(self, rank: int) -> None:
        now_ns, node, inbox = self._clock.now_ns, self._nodes[rank], self._inboxes[rank]
        if self._receipts:
            self._receipts[rank].add(now_ns, inbox)
        if self._second is not None and node.lookahead_ns:
            computed = self._second.submit(node.step, now_ns, inbox.taken())
            self._push(now_ns + node.lookahead_ns, rank, _UnderWay(now_ns, computed))
            return
        woken: dict[int, None] = {}
        outs = node.step(now_ns, inbox)
        inbox.clear()
        for out in outs:
            if out.delay_ns:
                self._push(now_ns + out.delay_ns, rank, out)
            else:
                self._publish(out.topic, out.message)
                woken.update(dict.fromkeys(self._wakes.get(out.topic, ())))
        for reader in woken:  # once all of it is published, as it may wake this node again
            self._step(reader)

    def _join(self) -> None:
        """Put the messages of the step at the queue's head, once it is computed, in its place."""
        due_ns, rank, serial, _, what = heapq.heappop(self._queue)
        assert isinstance(what, _UnderWay)
        for index, out in enumerate(what.outs.result()):
            at_ns = what.begun_ns + out.delay_ns
            if at_ns < due_ns:
                raise RuntimeError(f"node {self._nodes[rank].name!r} publishes {out.topic!r} within its lookahead")
            heapq.heappush(self._queue, (at_ns, rank, serial, index, out))

    def _publish(self, topic: str, message: Any) -> None:
        self._tap(self._clock.now_ns, topic, message)
        for reader in self._readers.get(topic, ()):
            self._inboxes[reader].put(topic, message)
