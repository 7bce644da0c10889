"""The lockstep host: virtual time, one thread, deterministic, as fast as the machine allows.

A queue ordered by (time, rank) holds the nodes' ticks and the messages' arrivals. Equal times follow the graph's order,
so that two runs of one seed give the same bytes.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from typing import Any

from hil.contract.node import Inbox, Node, Out, routes

Tap = Callable[[int, str, Any], None]


class Clock:
    """The run's virtual time, readable by memory wires."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        return self.now_ns


class Lockstep:
    """Drives `nodes` in virtual time; `tap(now_ns, topic, message)` receives every message as it is published."""

    def __init__(self, nodes: Sequence[Node], clock: Clock, tap: Tap) -> None:
        self._nodes, self._clock, self._tap = nodes, clock, tap
        self._inboxes = [Inbox(node.inputs) for node in nodes]
        self._readers, self._wakes = routes(nodes)
        # Queue entries: (time, rank, serial, out). out None is a tick of node `rank`; a message's rank is that of its
        # publisher, so it reaches readers before any later node of the same instant steps.
        self._queue: list[tuple[int, int, int, Out | None]] = []
        self._serial = 0
        for rank, node in enumerate(nodes):
            if node.period_ns:
                self._push(0, rank, None)

    def _push(self, time_ns: int, rank: int, out: Out | None) -> None:
        heapq.heappush(self._queue, (time_ns, rank, self._serial, out))
        self._serial += 1

    def run(self, until: Callable[[int], bool]) -> int:
        """Run until `until(now_ns)` is true, checked once per instant; returns the virtual time reached (ns)."""
        queue, clock, nodes = self._queue, self._clock, self._nodes
        while queue:
            time_ns = queue[0][0]
            if time_ns != clock.now_ns and until(clock.now_ns):
                break
            clock.now_ns = time_ns
            _, rank, _, out = heapq.heappop(queue)
            if out is None:
                self._step(rank)
                self._push(time_ns + nodes[rank].period_ns, rank, None)
            else:
                self._publish(out.topic, out.message)
                for reader in self._wakes.get(out.topic, ()):
                    self._step(reader)
        return clock.now_ns

    def _step(self, rank: int) -> None:
        inbox = self._inboxes[rank]
        outs = self._nodes[rank].step(self._clock.now_ns, inbox)
        inbox.clear()
        woken: dict[int, None] = {}
        for out in outs:
            if out.delay_ns:
                self._push(self._clock.now_ns + out.delay_ns, rank, out)
            else:
                self._publish(out.topic, out.message)
                woken.update(dict.fromkeys(self._wakes.get(out.topic, ())))
        for reader in woken:  # once all of it is published, as it may wake this node again
            self._step(reader)

    def _publish(self, topic: str, message: Any) -> None:
        self._tap(self._clock.now_ns, topic, message)
        for reader in self._readers.get(topic, ()):
            self._inboxes[reader].put(topic, message)
