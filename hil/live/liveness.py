"""Liveness of the supervisor as a service detects it, and the resource usage of this process."""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from hil.live.orphaned import mapped_memory

RECEIVED_WITHIN_NS = 3_000_000_000  # the supervisor publishes five times a second
_PAGE_KB = resource.getpagesize() // 1024


class Presence:
    """Liveness of the supervisor: the parent process exists, and the supervisor's orders arrive over the bus.

    No orders also means no hub: a service that drives a device must not fly on without the bus.
    """

    def __init__(
        self,
        *,
        remote: bool = False,
        clock: Callable[[], int] = time.monotonic_ns,
        parent: Callable[[], int] = os.getppid,
    ) -> None:
        """`remote`: started by hand on another host, so that the parent process is not the supervisor."""
        self._remote, self._clock, self._parent = remote, clock, parent
        self._first_parent, self._received_ns = parent(), 0

    def received(self) -> None:
        """An order of the supervisor has arrived."""
        self._received_ns = self._clock()

    def orphaned(self) -> bool:
        """Whether the parent process has ended."""
        return not self._remote and self._parent() != self._first_parent

    def orphaned_soon(self) -> bool:
        """The same, for a signal handler: the signal may arrive shortly before the parent's process id changes."""
        for _ in range(20):
            if self.orphaned():
                return True
            time.sleep(0.01)
        return False

    def gone(self) -> str:
        """Why the supervisor counts as lost; empty while it is present, or before its first order."""
        if self.orphaned():
            return "the supervisor is gone"
        age_ns = self._clock() - self._received_ns
        if self._received_ns and age_ns > RECEIVED_WITHIN_NS:
            return f"nothing received from supervisor and hub for {age_ns / 1e9:.1f} s"
        return ""


def footprint() -> dict[str, Any]:
    """Resource usage of this process: own and resident memory (kB), processor time so far (s), and its files in shared
    memory, whose pages count as resident in every process that has read them."""
    found: dict[str, Any] = {"cpu_s": round(time.process_time(), 3), "memory": sorted(mapped_memory())}
    with suppress(OSError, ValueError, IndexError):
        resident, shared = map(int, Path("/proc/self/statm").read_text().split()[1:3])
        found["rss_kb"], found["own_kb"] = resident * _PAGE_KB, (resident - shared) * _PAGE_KB
    return found
