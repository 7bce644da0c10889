"""Faults of the vehicle's wire, in both directions: datagrams of MAVLink."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from hil.faults.fault import Fault, Host, Milliseconds, Parameters, Share
from kernel.random import uniform


class _Link(Fault):
    nodes = ("vehicle_link",)


class MavlinkLoss(_Link):
    """A share of the datagrams is lost."""

    kind = "mavlink.loss"

    class Parameters(Parameters):
        share: Share = 0.3

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        return [] if self.chance(self.p.share) else [(0, item)]


class MavlinkDown(_Link):
    """Nothing passes."""

    kind = "mavlink.down"

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        return []


class MavlinkDelay(_Link):
    """Datagrams take longer."""

    kind = "mavlink.delay"

    class Parameters(Parameters):
        delay_ms: Milliseconds = 60.0

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        return [(round(self.p.delay_ms * 1e6), item)]


class MavlinkJitter(_Link):
    """Datagrams take longer by a random time up to `delay_ms`, in order."""

    kind = "mavlink.jitter"

    class Parameters(Parameters):
        delay_ms: Milliseconds = 60.0

    def begin(self, host: Host) -> None:
        self._last_ns = {True: 0, False: 0}

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        wanted_ns = self.now_ns + round(float(uniform(self.rng, 0.0, self.p.delay_ms)) * 1e6)
        self._last_ns[outward] = max(self._last_ns[outward], wanted_ns)
        return [(self._last_ns[outward] - self.now_ns, item)]


class MavlinkReordering(_Link):
    """A share of the datagrams is overtaken by those of the next `delay_ms`."""

    kind = "mavlink.reordering"

    class Parameters(Parameters):
        share: Share = 0.3
        delay_ms: Milliseconds = 25.0

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        return [(round(self.p.delay_ms * 1e6) if self.chance(self.p.share) else 0, item)]


class MavlinkDuplicates(_Link):
    """A share of the datagrams arrives a second time, `delay_ms` later."""

    kind = "mavlink.duplicates"

    class Parameters(Parameters):
        share: Share = 0.5
        delay_ms: Milliseconds = 20.0

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        again = [(round(self.p.delay_ms * 1e6), item)] if self.chance(self.p.share) else []
        return [(0, item), *again]


class MavlinkCorruption(_Link):
    """In a share of the datagrams `bytes` bytes are changed at random."""

    kind = "mavlink.corruption"

    class Parameters(Parameters):
        share: Share = 0.3
        bytes: Annotated[int, Field(ge=1, le=64)] = 2

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        if not item or not self.chance(self.p.share):
            return [(0, item)]
        changed = bytearray(item)
        for _ in range(self.p.bytes):
            changed[int(uniform(self.rng, 0.0, len(changed)))] ^= 1 + int(uniform(self.rng, 0.0, 255.0))
        return [(0, bytes(changed))]


KINDS = (
    MavlinkLoss, MavlinkDown, MavlinkDelay, MavlinkJitter, MavlinkReordering, MavlinkDuplicates, MavlinkCorruption,
)  # fmt: skip
