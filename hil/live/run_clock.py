"""The run's time in one process: the hub's monotonic clock minus its value at the run's start.

On another host the offset to the hub's clock is measured and followed in steps that are too small to disturb a node.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from hil.bus.clock import Clock, ClockWatch, DateWatch

ERROR_LIMIT_NS = 5_000_000  # of the offset: half a control period is the largest error that flight tolerates
DATE_LIMIT_NS = 1_000_000_000
DRIFT_LIMIT_NS = 5_000_000
_FOLLOW_NS = 100_000  # at most, twice a second


class RunTime:
    """`now()` is the run's time in ns. `tick()` is called about twice a second."""

    def __init__(
        self, watch: ClockWatch, date: DateWatch | None = None, clock: Callable[[], int] = time.monotonic_ns
    ) -> None:
        """Measures the offset at once. `date` watches this host's date where no other process does.

        Raises TimeoutError if the hub does not answer.
        """
        self._watch, self._date, self._clock = watch, date, clock
        self.first: Clock = watch.measure()
        self._applied_ns = self.first.offset_ns
        self._epoch_ns: int | None = None

    @property
    def begun(self) -> bool:
        return self._epoch_ns is not None

    def begin(self, epoch_ns: int) -> None:
        """The run starts when the hub's clock shows `epoch_ns`."""
        self._epoch_ns = epoch_ns

    def now(self) -> int:
        return self._clock() + self._applied_ns - (self._epoch_ns or 0)

    def tick(self) -> None:
        """Follow the hub's clock; nothing to do where it is our own."""
        best = self._watch.best
        if self.first.shared or best is None:
            return
        self._watch.ask()
        by = best.offset_ns - self._applied_ns
        self._applied_ns += max(-_FOLLOW_NS, min(_FOLLOW_NS, by))

    def remarks(self) -> list[str]:
        """What happened to the clocks, each once it happens."""
        text = self._date.text() if self._date is not None else ""
        return [text] if text else []

    def table(self) -> dict[str, Any]:
        """For the supervisor and the run's summary, ns: `date_ns` is the hub's date less ours."""
        best = self._watch.best or self.first
        return {
            "offset_ns": best.offset_ns, "error_ns": best.error_ns, "date_ns": best.date_ns,
            "moved_ns": self._watch.moved_ns, "shared": self.first.shared,
        }  # fmt: skip


def clock_fault(service: str, table: dict[str, Any]) -> str:
    """Why a run cannot start with this clock; empty if it can."""
    error_ns = int(table.get("error_ns", 0))
    if table.get("shared", True) or error_ns <= ERROR_LIMIT_NS:
        return ""
    return (
        f"{service}: its host's clock can be compared with the hub's only to within {error_ns / 1e6:.1f} ms, allowed "
        f"are {ERROR_LIMIT_NS / 1e6:.0f}: the network between them is too slow or too busy"
    )


def clock_lines(service: str, table: dict[str, Any]) -> list[str]:
    """The offset in words, and remarks where it is worth one; nothing for a clock that is the hub's own."""
    if table.get("shared", True):
        return []
    lines = [
        f"{service}: on another host; its clock is {-table['offset_ns'] / 1e9:+.6f} s from the hub's, known to "
        f"{table['error_ns'] / 1e6:.3f} ms, moved by {table['moved_ns'] / 1e6:+.3f} ms during the run"
    ]
    if abs(table["moved_ns"]) > DRIFT_LIMIT_NS:
        lines.append(f"{service}: the clocks drifted far apart during the run: its times are less certain")
    if abs(table["date_ns"]) > DATE_LIMIT_NS:
        lines.append(
            f"{service}: its host's date is {-table['date_ns'] / 1e9:+.1f} s from the hub's: set both by NTP, "
            "certificates and signatures go by it"
        )
    return lines
