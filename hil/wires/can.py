"""A CAN wire over any python-can bus: the car's real one (socketcan), or a stand-in (virtual, udp_multicast)."""

from __future__ import annotations

import contextlib
from collections import deque
from typing import Any

import can

from hil.contract.wire import CanFrame
from hil.wires import WireError

_AT_ONCE = 1024  # frames taken in one `receive`, so that a busy bus cannot delay a control loop
_ECHOES = 256  # own frames that may still come back; older ones count as lost


class PythonCanWire:
    """One python-can bus as a CAN wire: standard data frames only, without its own frames; it raises nothing in flight.

    `rejected` counts received frames that are not standard data frames, `send_errors` frames that the bus did not take
    (bus off, full queue, interface down). Nothing is ever sent periodically by the kernel or by python-can: that would
    keep a car moving after the service that commands it has died.
    """

    def __init__(self, bus: can.BusABC, *, echoes: bool = False) -> None:
        """`echoes`: this bus returns sent frames (udp_multicast does), which are then removed."""
        self._bus, self._closed = bus, False
        self._own: deque[tuple[int, bytes]] | None = deque(maxlen=_ECHOES) if echoes else None
        self.rejected = self.send_errors = 0

    def send(self, frame: CanFrame) -> None:
        """One frame onto the bus. Raises ValueError for an id or length that CAN 2.0 does not have."""
        if self._closed:
            raise WireError("this CAN wire is closed")
        can_id, data = int(frame.can_id), bytes(frame.data)
        if not 0 <= can_id <= 0x7FF or len(data) > 8:
            raise ValueError(f"CAN frame {can_id:#x} with {len(data)} bytes: 11-bit ids and up to 8 bytes only")
        message = can.Message(arbitration_id=can_id, data=data, is_extended_id=False)
        try:
            self._bus.send(message)
        except (can.CanError, OSError):
            self.send_errors += 1
            return
        if self._own is not None:
            self._own.append((can_id, data))

    def receive(self) -> list[CanFrame]:
        """Frames that have come, oldest first; at most 1024, the rest stays for the next call."""
        frames: list[CanFrame] = []
        if self._closed:
            return frames
        for _ in range(_AT_ONCE):
            try:
                message = self._bus.recv(timeout=0)
            except (can.CanError, OSError):
                self.rejected += 1
                break
            if message is None:
                break
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
        if message.is_extended_id or message.is_error_frame or message.is_remote_frame or message.is_fd:
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
    `ip link set can0 up type can bitrate 500000`.
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
    return PythonCanWire(bus, echoes=interface == "udp_multicast")


def _hint(interface: str, channel: str, error: Exception) -> str:
    text = str(error) or type(error).__name__
    if interface == "udp_multicast" and "msgpack" in text:
        return "udp_multicast needs the package msgpack (pip install 'python-can[multicast]')"
    if interface == "socketcan":
        return f"{text}; is the adapter plugged in and up (ip link set {channel} up type can bitrate 500000)?"
    return text
