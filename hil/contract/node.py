"""What a node is: declared topics, a period, and one deterministic step. The same node runs in every host."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class Out(NamedTuple):
    """One message to publish; readers see it `delay_ns` after the step's time (transport, processing)."""

    topic: str
    message: Any
    delay_ns: int = 0


class Inbox:
    """What has arrived for one node: every message since its last step, and the newest one ever, per topic."""

    def __init__(self, topics: Sequence[str]) -> None:
        self._new: dict[str, list[Any]] = {topic: [] for topic in topics}
        self._latest: dict[str, Any] = dict.fromkeys(topics)
        self._filled: list[list[Any]] = []  # of the queues, those that are not empty, perhaps more than once

    def put(self, topic: str, message: Any) -> None:
        queue = self._new[topic]
        queue.append(message)
        self._filled.append(queue)
        self._latest[topic] = message

    def new(self, topic: str) -> list[Any]:
        """Messages that arrived since the last step, oldest first."""
        return self._new[topic]

    def latest(self, topic: str) -> Any | None:
        """The newest message ever received on `topic`, or None."""
        return self._latest[topic]

    def taken(self) -> Inbox:
        """What it holds now, as an inbox of its own; nothing is new in this one then."""
        taken = Inbox(())
        taken._new, taken._latest = self._new, self._latest.copy()
        self._new, self._filled = {topic: [] for topic in self._new}, []
        return taken

    def clear(self) -> None:
        for queue in self._filled:
            queue.clear()
        self._filled.clear()


class Node:
    """An adapter around one component; the base class of every node, with all that a host may ask of it.

    A node steps every `period_ns` (0: never by time) and whenever a message arrives on one of `wakes`.
    """

    name: str
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    wakes: tuple[str, ...] = ()
    period_ns: int = 0
    lookahead_ns: int = 0
    """No message of a step is published sooner than this after it. Where it is not 0, the step reaches nothing but the
    node and its inbox: a host may compute it on another thread while other nodes step."""

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        """Consume what is new in `inbox` at the run's time `now_ns`; may not read a clock, touch a file or block."""
        raise NotImplementedError(f"{type(self).__name__} has no step")

    def permit(self, arming: Any) -> None:
        """What this node drives may be armed, if it is as the table `arming` says; nothing to do for other nodes."""

    def abort(self, why: str) -> None:
        """Bring what this node drives to its safe state; nothing to do for a node that drives no device."""

    @property
    def safe(self) -> bool:
        """Whether what this node drives is in its safe state, so that its process may end."""
        return True

    @property
    def counters(self) -> Mapping[str, int]:
        """What this node has rejected or dropped so far: description -> count."""
        return {}

    def close(self) -> None:
        """Release what the node holds outside its process's memory."""


def routes(nodes: Sequence[Node]) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
    """Which nodes read each topic and which it wakes, as indices into `nodes`."""
    readers: dict[str, list[int]] = {}
    wakes: dict[str, list[int]] = {}
    for rank, node in enumerate(nodes):
        for topic in node.inputs:
            readers.setdefault(topic, []).append(rank)
        for topic in node.wakes:
            wakes.setdefault(topic, []).append(rank)
    return readers, wakes
