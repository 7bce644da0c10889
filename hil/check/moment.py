"""A moment by two clocks: the date, and the time since this computer was started, which no one can set back."""

from __future__ import annotations

import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


@dataclass(frozen=True)
class Moment:
    """`boot` names the start of the computer from which `uptime_ns` counts, suspended time included; empty where the
    system does not tell it."""

    utc: datetime
    boot: str = ""
    uptime_ns: int = 0

    @classmethod
    def now(cls) -> Moment:
        """This moment, on this computer."""
        try:
            boot, uptime_ns = _BOOT_ID.read_text().strip(), time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        except OSError:
            boot, uptime_ns = "", 0
        return cls(datetime.now(UTC), boot, uptime_ns)

    def seconds_since(self, utc: datetime, boot: str, uptime_ns: int) -> float:
        """From the given moment to this one: by the time since the start if it is the same one, else by the date."""
        if boot and boot == self.boot:
            return (self.uptime_ns - uptime_ns) * 1e-9
        return (self.utc - utc).total_seconds()
