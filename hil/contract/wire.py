"""What carries a device's own protocol. Drivers and simulated devices take any object with these methods.

In memory here (lockstep and tests); UDP and CAN adapters stand in `hil/wires/` and obey the same contract suite.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol


class ByteWire(Protocol):
    """A datagram or byte stream (MAVLink). `receive` never blocks; one item per datagram, oldest first."""

    def send(self, data: bytes, /) -> object: ...

    def receive(self) -> list[bytes]: ...

    def close(self) -> None: ...


class CanFrame(NamedTuple):
    """A CAN 2.0 data frame: 11-bit identifier and up to 8 bytes."""

    can_id: int
    data: bytes


class CanWire(Protocol):
    """A CAN bus. `receive` never blocks and never returns what this end sent; `send` is False for a refused frame."""

    def send(self, frame: CanFrame, /) -> bool | None: ...

    def receive(self) -> list[CanFrame]: ...

    def close(self) -> None: ...


class _End:
    def __init__(self, clock: Callable[[], int], delay_ns: int) -> None:
        self._clock, self._delay_ns = clock, delay_ns
        self._inbound: deque[tuple[int, object]] = deque()
        self.peer: _End

    def send(self, item: object) -> None:
        self.peer._inbound.append((self._clock() + self._delay_ns, item))

    def receive(self) -> list:
        now, items = self._clock(), []
        while self._inbound and self._inbound[0][0] <= now:
            items.append(self._inbound.popleft()[1])
        return items

    def close(self) -> None:
        self._inbound.clear()


def memory_pair(clock: Callable[[], int], delay_ns: int = 0) -> tuple[_End, _End]:
    """Two ends of a wire in memory: what one sends the other receives `delay_ns` later by `clock` (ns, any epoch)."""
    a, b = _End(clock, delay_ns), _End(clock, delay_ns)
    a.peer, b.peer = b, a
    return a, b
