"""Which key of the bus carries far more messages than the contract has, and which process publishes on it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from hil.bus.leaf import CONTROL, EVENT, HEALTH, TOPIC, Bus
from hil.contract.topics import TOPICS
from hil.safety.topic_liveness import publisher

_TIMES = 10.0  # of the contract's rate; bursts after a stop of the process reach three times
_LEAST_HZ = 300.0  # of keys without a rate: events, orders, health
_WARN_NS = 1_000_000_000


class Floods:
    """Counts messages for the supervisor: of the topics that it watches all the time, of every key once asked to."""

    def __init__(self, bus: Bus, health: Mapping[str, Mapping[str, Any]]) -> None:
        """`health`: a live table, service -> its newest health."""
        self.counts: dict[str, int] = {}  # topic -> messages since the last `warning`
        self._bus, self._health = bus, health
        self._census: dict[str, int] = {}
        self._since_ns = self._census_ns = time.monotonic_ns()

    def warning(self) -> str:
        """Which watched topic was flooded within the last second or more; empty if none was, or it is too early."""
        now = time.monotonic_ns()
        if now - self._since_ns < _WARN_NS:
            return ""
        counts = {TOPIC + topic: count for topic, count in list(self.counts.items())}
        seconds, self._since_ns = (now - self._since_ns) * 1e-9, now
        self.counts.clear()
        return flood_fault(counts, seconds, self._health)

    def count_all(self) -> None:
        """Count the messages on every key of the bus from now on: too many to do so all the time."""
        self._census, self._census_ns = self._bus.census(), time.monotonic_ns()

    def fault(self) -> str:
        """Which process floods the bus since `count_all`; empty if none does."""
        seconds = (time.monotonic_ns() - self._census_ns) * 1e-9
        return flood_fault(self._census, seconds, self._health) if seconds > 0 else ""


def flood_fault(counts: Mapping[str, int], seconds: float, health: Mapping[str, Mapping[str, Any]]) -> str:
    """`SERVICE floods KEY (...)` for the key with the most messages beyond its limit; empty if none is.

    `counts`: messages by key within `seconds`. The publisher of a topic is the one that declares it in its health, and
    on a closed bus no other can be.
    """
    worst, most = "", 1.0
    for key, count in list(counts.items()):
        due_hz = TOPICS[key.removeprefix(TOPIC)].hz if key.removeprefix(TOPIC) in TOPICS else 0.0
        rate = count / seconds
        beyond = rate / max(_TIMES * due_hz, _LEAST_HZ)
        if beyond > most:
            due = f", {due_hz:g} are due" if due_hz else ""
            worst, most = f"{_author(key, health)} floods {_what(key)} ({rate:.0f} messages a second{due})", beyond
    return worst


def _author(key: str, health: Mapping[str, Mapping[str, Any]]) -> str:
    for owned in (EVENT, HEALTH):
        if key.startswith(owned):
            return key.removeprefix(owned)
    return "supervisor" if key == CONTROL else publisher(key.removeprefix(TOPIC), health)


def _what(key: str) -> str:
    if key.startswith(EVENT):
        return "event"
    return "its health" if key.startswith(HEALTH) else "orders" if key == CONTROL else key.removeprefix(TOPIC)
