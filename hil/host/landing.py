"""When a lockstep flight is over: after the run's end the vehicle still lands, and a fault must not go unnoticed.

With faults the flight is watched as the live supervisor watches it: a topic that grows old gives the attempt up, and
every node brings its device to the safe state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hil.contract.node import Node
from hil.contract.topics import TOPICS
from hil.safety.topic_liveness import NOT_WATCHED, liveness_fault
from hil.scoring.flight_class import LAND_LIMIT_S, FlightJudge

_CHECK_NS = 100_000_000
_WATCHED = frozenset(topic for topic, row in TOPICS.items() if row.hz and topic not in NOT_WATCHED)


class Landing:
    """A tap, and the condition that ends the flight. `trouble`: why the attempt was given up."""

    def __init__(self, nodes: Sequence[Node], judge: FlightJudge, watched: bool) -> None:
        """`watched`: give the attempt up if a topic grows old."""
        self._nodes, self._judge, self._watched = nodes, judge, watched
        self._devices = [node for node in nodes if node.name == "vehicle_device"]
        self._received: dict[str, int] = {}
        self._health = {node.name: {"outputs": node.outputs, "received_ns": 0} for node in nodes}
        self._due_ns = 0
        self._end_ns: int | None = None
        self.trouble = ""

    @property
    def topics(self) -> frozenset[str]:
        """Those that it wants to know of."""
        return _WATCHED if self._watched else frozenset()

    @property
    def motors_off(self) -> bool:
        return all(device.safe for device in self._devices)

    def __call__(self, now_ns: int, topic: str, message: Any) -> None:
        if topic in self.topics:
            self._received[topic] = now_ns

    def over(self, now_ns: int, stage: str) -> bool:
        """Whether the flight is over at `now_ns`."""
        if self._watched and stage != "ended" and not self.trouble and now_ns >= self._due_ns:
            self._due_ns = now_ns + _CHECK_NS
            self.trouble = liveness_fault(now_ns, self._health, self._received, ())
            if self.trouble:
                for node in self._nodes:
                    node.abort(self.trouble)
        if stage != "ended" and not self.trouble:
            return False
        self._end_ns = now_ns if self._end_ns is None else self._end_ns
        return self._judge.settled(self.motors_off) or now_ns - self._end_ns > LAND_LIMIT_S * 1e9
