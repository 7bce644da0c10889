"""Whether the supervisor is still there, and what this process takes of its machine."""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from hil.live.orphaned import mapped_memory

SILENT_NS = 3_000_000_000  # the supervisor speaks five times a second
_PAGE_KB = resource.getpagesize() // 1024


class Presence:
    """The supervisor is there while the process that started this one lives and its word comes over the bus.

    Its silence is the hub's silence too: whoever drives a device must not fly on deaf.
    """

    def __init__(
        self,
        *,
        remote: bool = False,
        clock: Callable[[], int] = time.monotonic_ns,
        parent: Callable[[], int] = os.getppid,
    ) -> None:
        """`remote`: started by hand on another host, so that the parent process is nobody."""
        self._remote, self._clock, self._parent = remote, clock, parent
        self._first_parent, self._heard_ns = parent(), 0

    def heard(self) -> None:
        """The supervisor has said something."""
        self._heard_ns = self._clock()

    def orphaned(self) -> bool:
        """Whether the process that started this one is gone."""
        return not self._remote and self._parent() != self._first_parent

    def orphaned_soon(self) -> bool:
        """The same, for a signal that may tell of the parent's death a moment before the parent's number changes."""
        for _ in range(20):
            if self.orphaned():
                return True
            time.sleep(0.01)
        return False

    def gone(self) -> str:
        """Why the supervisor is taken for gone; empty while it is there, or has not yet said anything."""
        if self.orphaned():
            return "the supervisor is gone"
        silent_ns = self._clock() - self._heard_ns
        if self._heard_ns and silent_ns > SILENT_NS:
            return f"supervisor and hub are silent for {silent_ns / 1e9:.1f} s"
        return ""


def footprint() -> dict[str, Any]:
    """What this process takes: memory of its own and with what it shares (kB), processor time so far (s), and its
    files in shared memory, whose pages count as resident in every process that has read them."""
    found: dict[str, Any] = {"cpu_s": round(time.process_time(), 3), "memory": sorted(mapped_memory())}
    with suppress(OSError, ValueError, IndexError):
        resident, shared = map(int, Path("/proc/self/statm").read_text().split()[1:3])
        found["rss_kb"], found["own_kb"] = resident * _PAGE_KB, (resident - shared) * _PAGE_KB
    return found
