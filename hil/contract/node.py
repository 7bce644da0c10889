"""What a node is: declared topics, a period, and one pure-looking step. The same node runs in every host."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol


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

    def put(self, topic: str, message: Any) -> None:
        self._new[topic].append(message)
        self._latest[topic] = message

    def new(self, topic: str) -> list[Any]:
        """Messages that arrived since the last step, oldest first."""
        return self._new[topic]

    def latest(self, topic: str) -> Any | None:
        """The newest message ever received on `topic`, or None."""
        return self._latest[topic]

    def clear(self) -> None:
        for queue in self._new.values():
            queue.clear()


class Node(Protocol):
    """An adapter around one component. `step` may not read a clock, touch a file or block.

    A node steps every `period_ns` (0: never by time) and whenever a message arrives on one of `wakes`.
    """

    @property
    def name(self) -> str: ...
    @property
    def inputs(self) -> tuple[str, ...]: ...
    @property
    def outputs(self) -> tuple[str, ...]: ...
    @property
    def wakes(self) -> tuple[str, ...]: ...
    @property
    def period_ns(self) -> int: ...

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]: ...

    def close(self) -> None: ...


def routes(nodes: Sequence[Node]) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
    """Who reads each topic and whom it wakes, as indices into `nodes`."""
    readers: dict[str, list[int]] = {}
    wakes: dict[str, list[int]] = {}
    for rank, node in enumerate(nodes):
        for topic in node.inputs:
            readers.setdefault(topic, []).append(rank)
        for topic in node.wakes:
            wakes.setdefault(topic, []).append(rank)
    return readers, wakes
