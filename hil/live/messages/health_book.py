"""The newest health of every service, and which services are served by two processes at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from hil.assembly.node_table import SERVICES
from hil.bus.leaf import OBSERVERS
from hil.live.messages.health import clean_health

_BOTH_NS = 1_000_000_000  # two processes of one service, both heard within this time, serve at once
_MOST_MEMORY = 1000  # names that are kept, of some ten that a run has


class HealthBook:
    """Takes healths from the bus. `health`: service -> the newest, with `received_ns`; `memory`: names of what the
    processes hold in shared memory."""

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.health: dict[str, dict[str, Any]] = {}
        self.memory: set[str] = set()
        self._clock = clock
        self._fixed = False
        self._doubles: dict[str, tuple[str, int]] = {}  # service -> text, when its second process was heard last

    def note(self, table: Mapping[str, Any]) -> None:
        """One health. That of a second process of a service does not count."""
        health, now = clean_health(table), self._clock()
        service = health["service"]
        if service not in SERVICES and service not in OBSERVERS:
            return
        known = self.health.get(service, health)
        another = known.get("session") != health.get("session")
        if another and (self._fixed or now - known["received_ns"] < _BOTH_NS):
            text = f"two processes serve as {service}: {_process(known)} and {_process(health)}: end one of them"
            self._doubles[service] = text, now
            return
        self.health[service] = {**health, "received_ns": now}
        if len(self.memory) < _MOST_MEMORY:
            self.memory.update(health.get("memory", ()))

    def fix(self) -> dict[str, str]:
        """From now on the processes known now serve, and no other; returns service -> session."""
        self._fixed = True
        return {service: table["session"] for service, table in list(self.health.items()) if "session" in table}

    def double(self) -> str:
        """Which service is served by two processes now, as text; empty if none is."""
        now = self._clock()
        for service, (text, heard_ns) in list(self._doubles.items()):
            if max(now - heard_ns, now - self.health[service]["received_ns"]) < _BOTH_NS:
                return text
        return ""


def _process(table: Mapping[str, Any]) -> str:
    """A process, as its health names it."""
    return f"process {table.get('pid', '?')} on {table.get('host', 'an unknown host')}"
