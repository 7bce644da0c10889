"""Processor load of the machine during a live run, with the share that its hypervisor gave to other machines, and
whether it stood still."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

_STAT = Path("/proc/stat")
_IDLE, _IOWAIT, _STOLEN, _COUNTED = 3, 4, 7, 8  # columns; what follows them, guests, is counted in the first ones
_STALL_S = 0.1  # by which a sleep is too long; commands that are silent for 0.12 s end a dive


class Load(NamedTuple):
    """The machine at a moment. Processor times since its start, in ticks, over all cores."""

    average: float
    idle: int
    stolen: int
    total: int


def load_now(stat: Path = _STAT) -> Load:
    """What the kernel reports; times are 0 where it does not."""
    average = os.getloadavg()[0]
    try:
        ticks = [int(word) for word in stat.read_text().splitlines()[0].split()[1 : 1 + _COUNTED]]
        return Load(average, ticks[_IDLE] + ticks[_IOWAIT], ticks[_STOLEN], sum(ticks))
    except (OSError, ValueError, IndexError):
        return Load(average, 0, 0, 0)


def load_table(before: Load, after: Load) -> dict[str, Any]:
    """Load averages before and after; shares (0..1) of the processors' time between that were idle, and stolen."""
    total = max(1, after.total - before.total)
    return {
        "cores": os.cpu_count(),
        "load_average": (before.average, after.average),
        "idle": round((after.idle - before.idle) / total, 3),
        "stolen": round((after.stolen - before.stolen) / total, 3),
    }


def load_line(table: dict[str, Any]) -> str:
    """One line of text."""
    before, after = table["load_average"]
    line = f"on {table['cores']} cores, {table['idle']:.0%} idle, load average {before:.1f} before, {after:.1f} after"
    if table["stolen"] >= 0.01:
        line += f"; {table['stolen']:.0%} of their time went to other guests of the machine's host"
    return line


def sleep(
    seconds: float, sleeping: Callable[[float], None] = time.sleep, clock: Callable[[], float] = time.monotonic
) -> str:
    """Sleep; returns what it says of the computer that this took much longer, empty if it did not."""
    begun = clock()
    sleeping(seconds)
    late = clock() - begun - seconds
    return f"this computer stood still for {late:.2f} s: what was late then was late by that" if late > _STALL_S else ""
