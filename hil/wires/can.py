"""A CAN wire over any python-can bus: the car's real one (socketcan), or a stand-in (virtual, udp_multicast)."""

from __future__ import annotations

import contextlib
import errno
from collections import deque
from typing import Any

import can

from hil.contract.wire import CanFrame
from hil.wires import WireError
from hil.wires.can_errors import BusErrors

_AT_ONCE = 1024  # frames taken in one `receive`, so that a busy bus cannot delay a control loop
_ECHOES = 256  # own frames that may still come back; older ones count as lost

REFUSALS = 10  # frames refused in a row that count as trouble: 0.2 s of motion commands
_GONE = (errno.ENODEV, errno.ENXIO, errno.ENETDOWN, errno.EBADF)


class PythonCanWire:
    """One python-can bus as a CAN wire: standard data frames only, without its own frames; it raises nothing in flight.

    `rejected` counts received frames that are not standard data frames, `send_errors` frames that the bus did not take
    (bus off, full queue, interface down), `receive_errors` failed reads. `lost` is the present trouble of the bus.
    Nothing is ever sent periodically by the kernel or by python-can: that would keep a car moving after the service
    that commands it has died.
    """

    def __init__(self, bus: can.BusABC, *, echoes: bool = False, name: str = "CAN bus") -> None:
        """`echoes`: this bus returns sent frames (udp_multicast does), which are then removed."""
        self._bus, self._closed, self._name = bus, False, name
        self.errors = BusErrors()
        self._refused_in_a_row, self._refusal, self._down = 0, "", ""
        self._own: deque[tuple[int, bytes]] | None = deque(maxlen=_ECHOES) if echoes else None
        self.rejected = self.send_errors = self.receive_errors = 0

    @property
    def lost(self) -> str:
        """Why no frames pass now; empty while they do. It can end: a bus restarts, an interface comes up again."""
        why = self._down or self.errors.trouble
        if not why and self._refused_in_a_row >= REFUSALS:
            why = f"takes no frames ({self._refusal})"
        return f"{self._name}: {why}" if why else ""

    def send(self, frame: CanFrame) -> bool:
        """One frame onto the bus; False if the bus refused it. Raises ValueError for what CAN 2.0 does not have."""
        if self._closed:
            raise WireError("this CAN wire is closed")
        can_id, data = int(frame.can_id), bytes(frame.data)
        if not 0 <= can_id <= 0x7FF or len(data) > 8:
            raise ValueError(f"CAN frame {can_id:#x} with {len(data)} bytes: 11-bit ids and up to 8 bytes only")
        message = can.Message(arbitration_id=can_id, data=data, is_extended_id=False)
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            self.send_errors += 1
            if not self._refused_in_a_row:
                self._refusal = str(error) or type(error).__name__
            self._refused_in_a_row += 1
            if _number(error) in _GONE:
                self._down = f"the adapter is gone or down ({self._refusal})"
            return False
        self._refused_in_a_row, self._down = 0, ""
        if self._own is not None:
            self._own.append((can_id, data))
        return True

    def receive(self) -> list[CanFrame]:
        """Frames that have come, oldest first; at most 1024, the rest stays for the next call."""
        frames: list[CanFrame] = []
        if self._closed:
            return frames
        for _ in range(_AT_ONCE):
            try:
                message = self._bus.recv(timeout=0)
            except (can.CanError, OSError) as error:
                self.receive_errors += 1
                self._down = f"the adapter is gone or down ({error})"
                break
            if message is None:
                break
            if message.is_error_frame:
                self.errors.error_frame(message.arbitration_id, bytes(message.data))
                continue
            self._down = ""
            self.errors.data_frame()
            frame = self._accept(message)
            if frame is not None:
                frames.append(frame)
        return frames

    def close(self) -> None:
        """Leave the bus; may be called twice."""
        if not self._closed:
            self._closed = True
            self._bus.shutdown()

    def _accept(self, message: can.Message) -> CanFrame | None:
        if message.is_extended_id or message.is_remote_frame or message.is_fd:
            self.rejected += 1
            return None
        frame = CanFrame(message.arbitration_id, bytes(message.data))
        if self._own is not None:
            with contextlib.suppress(ValueError):
                self._own.remove((frame.can_id, frame.data))
                return None
        return frame


def open_can(interface: str, channel: str, bitrate: int = 500_000, **options: Any) -> PythonCanWire:
    """A wire on python-can's `interface` ("socketcan" with channel "can0", "virtual", "udp_multicast", ...).

    Raises WireError if the bus cannot be opened here. For socketcan the bitrate is set in the kernel:
    `ip link set can0 up type can bitrate 500000 restart-ms 100`.
    """
    if interface not in can.interfaces.VALID_INTERFACES:
        known = ", ".join(sorted(can.interfaces.VALID_INTERFACES))
        raise WireError(f'there is no CAN interface "{interface}"; python-can knows {known}')
    if interface not in ("socketcan", "virtual", "udp_multicast"):
        options["bitrate"] = bitrate
    try:
        bus = can.Bus(interface=interface, channel=channel, receive_own_messages=False, **options)
    except (can.CanError, OSError, ValueError, NotImplementedError, AttributeError) as error:
        raise WireError(f"CAN {interface} {channel} cannot be opened: {_hint(interface, channel, error)}") from None
    return PythonCanWire(bus, echoes=interface == "udp_multicast", name=f"CAN {interface} {channel}")


def _number(error: Exception) -> int | None:
    return getattr(error, "error_code", None) or getattr(error, "errno", None)


def _hint(interface: str, channel: str, error: Exception) -> str:
    text = str(error) or type(error).__name__
    if interface == "udp_multicast" and "msgpack" in text:
        return "udp_multicast needs the package msgpack (pip install 'python-can[multicast]')"
    if interface == "socketcan":
        up = f"ip link set {channel} up type can bitrate 500000 restart-ms 100"
        return f"{text}; is the adapter plugged in and up ({up})?"
    return text
