"""A node with faults around it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hil.contract.messages import Faults
from hil.contract.node import Inbox, Node, Out
from hil.faults.fault import Fault
from hil.faults.wire import FaultyWires

TOPIC = "run/fault"


class FaultyNode(Node):
    """Decorates a node with the faults that act on it. Which of them are active it reads from the topic run/fault."""

    def __init__(self, build: Callable[[FaultyWires], Node], faults: Mapping[int, Fault], wires: FaultyWires) -> None:
        """`build` makes the node on `wires`; `faults` by their place in the scenario."""
        self._build, self._faults, self._wires = build, faults, wires
        self.node = node = build(wires)
        self.name, self.outputs, self.wakes, self.period_ns = node.name, node.outputs, node.wakes, node.period_ns
        self.lookahead_ns = node.lookahead_ns  # a fault delays or drops a message, it hastens none
        self.inputs = node.inputs if TOPIC in node.inputs else (*node.inputs, TOPIC)
        self._inbox = Inbox(node.inputs)
        self._active: list[Fault] = []

    def rebuild(self) -> None:
        """Replace the node by a fresh one, as after a restart."""
        self._wires.opened.clear()
        self.node = self._build(self._wires)

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        for topic in self.node.inputs:
            for message in inbox.new(topic):
                self._take(topic, message)
        self._switch(now_ns, inbox.latest(TOPIC))
        for fault in self._active:
            fault.act(self)
        for wire in self._wires.opened:
            wire.flush()
        if any(fault.stalls or fault.dead for fault in self._active):
            return []
        outs = self.node.step(now_ns + sum(fault.clock_ns for fault in self._active), self._inbox)
        self._inbox.clear()
        for fault in self._active:
            outs = [kept for out in outs for kept in fault.outgoing(out, self._inbox)]
        return outs

    def _take(self, topic: str, message: object) -> None:
        for fault in self._active:
            message = fault.incoming(topic, message)
            if message is None:
                return
        self._inbox.put(topic, message)

    def _switch(self, now_ns: int, state: Faults | None) -> None:
        """Begin and end faults as the timetable says."""
        wanted: Sequence[Fault] = [self._faults[i] for i in sorted(self._faults) if state and i in state.active]
        before, self._active = self._active, list(wanted)
        for fault in (*before, *wanted):
            fault.now_ns = now_ns
        for wire in self._wires.opened:
            wire.now_ns, wire.active = now_ns, frozenset(wanted)
        for fault in before:
            if fault not in wanted:
                fault.end(self)
        for fault in wanted:
            if fault not in before:
                fault.begin(self)

    def permit(self, arming: Any) -> None:
        self.node.permit(arming)

    def abort(self, why: str) -> None:
        """Passed on, but to a dead node."""
        if not any(fault.dead for fault in self._active):
            self.node.abort(why)

    @property
    def safe(self) -> bool:
        return self.node.safe

    @property
    def counters(self) -> Mapping[str, int]:
        return self.node.counters

    def close(self) -> None:
        self.node.close()
