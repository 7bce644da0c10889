"""Rate and age of every topic and service on a bus, compared with the contract table."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from rich import box
from rich.table import Table

from hil.bus.leaf import HEALTH, Bus, Credentials
from hil.contract.topics import TOPICS


@dataclass(frozen=True)
class Status:
    """What was received. `topics`: name -> (Hz, age of the newest in ms); topics that nothing published are absent."""

    services: dict[str, dict[str, Any]]
    topics: dict[str, tuple[float, float]]

    @property
    def fresh(self) -> bool:
        """Every topic that is published is as young as the contract wants."""
        rows = ((TOPICS[name], age) for name, (_, age) in self.topics.items())
        return all(not row.max_age_ms or age <= row.max_age_ms for row, age in rows)


def listen(endpoint: str, seconds: float, credentials: Credentials | None = None) -> Status:
    """Receive for `seconds`. Raises BusError without a hub."""
    services: dict[str, dict[str, Any]] = {}
    counts: dict[str, int] = {}
    with Bus(endpoint, credentials, identity="status") as bus:
        bus.on_table(HEALTH + "*", lambda table: services.update({str(table.get("service")): table}))
        received = bus.ages(TOPICS, counts)
        began = time.monotonic_ns()
        time.sleep(seconds)
        now = time.monotonic_ns()
    rate = 1e9 / (now - began)
    return Status(services, {t: (counts[t] * rate, (now - at) / 1e6) for t, at in received.items()})


def status_tables(seen: Status) -> list[Table]:
    """Services, then topics."""
    services = Table(box=box.SIMPLE_HEAD, title="services", title_justify="left")
    for column in ("service", "state", "pid", "nodes", "late", "missed", "lost"):
        services.add_column(column)
    for name, one in sorted(seen.services.items()):
        paces = one.get("nodes", {}).values()
        late, missed = (str(sum(p.get(key, 0) for p in paces)) for key in ("late", "missed"))
        lost = str(sum(one.get("lost", {}).values()) + sum(one.get("dropped", {}).values()))
        nodes = ", ".join(one.get("nodes", {}))
        services.add_row(name, str(one.get("state", "")), str(one.get("pid", "")), nodes, late, missed, lost)
    topics = Table(box=box.SIMPLE_HEAD, title="topics", title_justify="left")
    for column in ("topic", "Hz", "contract", "age ms", "contract"):
        topics.add_column(column, justify="left" if column == "topic" else "right")
    for name, row in TOPICS.items():
        hz, age = seen.topics.get(name, (0.0, None))
        stale = age is None or (row.max_age_ms and age > row.max_age_ms)
        topics.add_row(
            name, f"{hz:.1f}", f"{row.hz:g}" if row.hz else "event",
            "none" if age is None else f"{age:.0f}", f"{row.max_age_ms:g}" if row.max_age_ms else "-",
            style="yellow" if stale and row.hz else "",
        )  # fmt: skip
    return [services, topics]
