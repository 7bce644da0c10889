"""One MAVLink instance of the software PX4: its streams, the frames it receives, and its partner.

PX4 binds a UDP port, sends to a default address, and keeps the first sender as its partner for the life of the
process; packets of other senders are processed as well. Addresses belong to the wire: a UDP wire for this port starts
with PX4's default peer, keeps the first partner and accepts datagrams of other senders. A wire in memory has one
partner only.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, Protocol

from vehicle.px4.codec import MESSAGES, Frame, MessageType, Packer, Parser
from vehicle.px4.protocol import PX4_COMPONENT, PX4_SYSTEM

PARAMS_PER_TICK = 4  # 888 in 0.89 s (a real PX4 took 0.83 s)
_PARAM = struct.Struct("<4sHH16sB")
FASTEST_NS = 4_484_000  # PX4's 250 Hz loop gives 223 Hz at most
FASTEST_IMU_NS = 8_064_000  # and HIGHRES_IMU 124 Hz
_HIGHRES_IMU = 105


class Wire(Protocol):
    """What a port needs of a wire: `send` one datagram, `receive` those that have come (never blocks)."""

    def send(self, data: bytes, /) -> object: ...

    def receive(self) -> list[bytes]: ...


class Stream:
    """A periodic message of one port."""

    __slots__ = ("build", "default_ns", "due_ns", "fastest_ns", "id", "interval_ns")

    def __init__(self, id: int, interval_ns: int, first_ns: int, build: Callable[[Any, Any], None]) -> None:
        self.id, self.build = id, build
        self.fastest_ns = FASTEST_IMU_NS if id == _HIGHRES_IMU else FASTEST_NS
        self.default_ns = self.interval_ns = interval_ns  # 0: not sent
        self.due_ns = first_ns

    def set_interval(self, interval_us: float, now_ns: int) -> None:
        """SET_MESSAGE_INTERVAL: 0 default, negative stops."""
        if interval_us < 0:
            self.interval_ns = 0
        elif interval_us == 0:
            self.interval_ns = self.default_ns
        else:
            self.interval_ns = max(self.fastest_ns, int(interval_us * 1000))
        self.due_ns = max(now_ns, min(self.due_ns, now_ns + self.interval_ns))


class Port:
    """A MAVLink instance on one wire. `send` collects frames; `flush` makes one datagram of a tick's frames."""

    def __init__(self, name: str, wire: Wire) -> None:
        self.name = name
        self._wire = wire
        self.packer = Packer(PX4_SYSTEM, PX4_COMPONENT)
        self.parser = Parser()
        self.streams: dict[int, Stream] = {}
        self._active: list[Stream] = []
        self._next_ns = 0
        self._pending: list[bytes] = []
        self.sent = self.sent_bytes = self.received = self.received_bytes = 0
        self.silent: set[int] = set()  # message ids that are held back (fault hook)
        self._params: list[str] = []

    def add(self, stream: Stream) -> None:
        """Give the port a stream."""
        self.streams[stream.id] = stream
        self.reschedule()

    def reschedule(self) -> None:
        """Call it after a stream's interval has changed."""
        self._active = [s for s in self.streams.values() if s.interval_ns]
        self._next_ns = 0

    def publish(self, context: Any, now_ns: int) -> None:
        """Send what is due."""
        if now_ns < self._next_ns:
            return
        soonest = now_ns + 1_000_000_000
        for stream in self._active:
            if stream.due_ns <= now_ns:
                if stream.id not in self.silent:
                    stream.build(context, self)
                stream.due_ns += stream.interval_ns
                if stream.due_ns <= now_ns:
                    stream.due_ns = now_ns + stream.interval_ns
            if stream.due_ns < soonest:
                soonest = stream.due_ns
        self._next_ns = soonest

    def send(self, message: MessageType, *values: Any) -> None:
        """Add one message to the datagram of this tick."""
        self._pending.append(self.packer.pack(message, *values))

    def send_name(self, name: str, *values: Any) -> None:
        """`send` by name."""
        self.send(MESSAGES[name], *values)

    def send_param(self, name: str, value: bytes, kind: int, count: int, index: int) -> None:
        """PARAM_VALUE with the value's four bytes as they are: an INT32 may look like a signalling NaN."""
        payload = _PARAM.pack(value, count, index, name.encode(), kind)
        self._pending.append(self.packer.pack_payload(MESSAGES["PARAM_VALUE"], payload))

    def queue_params(self, names: list[str]) -> None:
        """Queue these parameters for sending."""
        self._params = names

    def take_params(self) -> list[str]:
        """The next queued parameters to send."""
        if not self._params:
            return []
        now, self._params = self._params[:PARAMS_PER_TICK], self._params[PARAMS_PER_TICK:]
        return now

    def send_raw(self, frame: bytes) -> None:
        """Forward a frame as it is."""
        self._pending.append(frame)

    def flush(self) -> None:
        """Send the datagram of this tick, if there is one."""
        if self._pending:
            data = b"".join(self._pending)
            self.sent += len(self._pending)
            self.sent_bytes += len(data)
            self._pending.clear()
            self._wire.send(data)

    def receive(self) -> list[Frame]:
        """Received frames, oldest first; garbage is counted in `parser`."""
        frames: list[Frame] = []
        for data in self._wire.receive():
            self.received_bytes += len(data)
            frames.extend(self.parser.feed(data))
        self.received += len(frames)
        return frames
