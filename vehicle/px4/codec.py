"""MAVLink 2 framing from pymavlink's own message tables: as its `pack`, but a few microseconds a message.

Packing reads no Python attributes and parsing decodes fields only when they are read, so that the software PX4 can send
its 430 messages a second at little cost. Tests compare every message with pymavlink's bytes.
"""

from __future__ import annotations

import struct
from typing import Any

from fastcrc.crc16 import mcrf4xx

from vehicle.px4.dialect import MESSAGES, MessageType

__all__ = ["MESSAGES", "Frame", "MessageType", "Packer", "Parser", "message_id"]

_HEADER = struct.Struct("<BBBBBBBHB")
_CRC = struct.Struct("<H")
V1_MARK, V2_MARK = 0xFE, 0xFD


class Packer:
    """Frames messages of one sender on one link: counts the sequence."""

    def __init__(self, system: int, component: int) -> None:
        self.system, self.component, self.sequence = system, component, 0

    def pack(self, message: MessageType, *values: Any) -> bytes:
        """One MAVLink 2 frame, trailing zeros cut off; `values` in definition order, as pymavlink's `xxx_encode`."""
        return self.pack_payload(message, message.payload(values))

    def pack_payload(self, message: MessageType, payload: bytes) -> bytes:
        """One frame around a payload that already lies as on the wire."""
        payload = payload if payload[-1] else (payload.rstrip(b"\0") or payload[:1])
        id = message.id
        sequence = self.sequence
        self.sequence = (sequence + 1) & 0xFF
        head = _HEADER.pack(V2_MARK, len(payload), 0, 0, sequence, self.system, self.component, id & 0xFFFF, id >> 16)
        body = head + payload
        return body + _CRC.pack(mcrf4xx(body[1:] + bytes((message.crc_extra,))))

    def send_name(self, name: str, *values: Any) -> bytes:
        """`pack` by the message's name."""
        return self.pack(MESSAGES[name], *values)


def message_id(frame: bytes) -> int:
    """The message's number in a MAVLink 2 frame."""
    return int.from_bytes(frame[7:10], "little")


class Frame:
    """A received frame; its fields are decoded when first read."""

    __slots__ = ("_fields", "component", "id", "message", "payload", "raw", "sequence", "system")

    def __init__(self, message: MessageType, system: int, component: int, sequence: int, payload: bytes, raw: bytes):
        self.message, self.id = message, message.id
        self.system, self.component, self.sequence = system, component, sequence
        self.payload, self.raw = payload, raw
        self._fields: Any = None

    @property
    def name(self) -> str:
        """The message's name, as in "HEARTBEAT"."""
        return self.message.name

    @property
    def fields(self) -> Any:
        """The message's fields as a named tuple."""
        if self._fields is None:
            self._fields = self.message.decode(self.payload)
        return self._fields


class Parser:
    """Bytes in, frames out: MAVLink 2 and 1, unsigned or signed (signatures are not checked). Never raises.

    `garbage_bytes` counts bytes that belong to no frame, `bad_frames` frames with a wrong checksum, `unknown_frames`
    those of messages the dialect does not know (their checksum cannot be verified).
    """

    def __init__(self) -> None:
        self._buffer = b""
        self.garbage_bytes = self.bad_frames = self.unknown_frames = 0

    def feed(self, data: bytes) -> list[Frame]:
        """Frames completed by `data`, oldest first."""
        buffer = self._buffer + data if self._buffer else data
        frames: list[Frame] = []
        at, end = 0, len(buffer)
        while at < end:
            mark = buffer[at]
            if mark not in (V1_MARK, V2_MARK):
                at += 1
                self.garbage_bytes += 1
                continue
            header = 10 if mark == V2_MARK else 6
            if end - at < header:
                break
            stop = at + header + buffer[at + 1] + 2
            if mark == V2_MARK:
                if buffer[at + 2] & 0xFE:  # an incompatibility flag that is not defined: not a frame
                    at += 1
                    self.garbage_bytes += 1
                    continue
                signed = buffer[at + 2] & 1
            else:
                signed = 0
            total = stop + 13 * signed
            if total > end:
                later = self._valid_after(buffer, at)
                if later < 0:
                    break
                self.garbage_bytes += later - at  # a start byte in garbage must not delay the frames after it
                at = later
                continue
            frame, known = self._check(buffer, at, header, stop, total)
            if frame is not None:
                frames.append(frame)
                at = total
            elif known:
                self.bad_frames += 1
                self.garbage_bytes += 1
                at += 1
            elif total == end or buffer[total] in (V1_MARK, V2_MARK):
                self.unknown_frames += 1
                at = total
            else:  # no frame follows, so this was none either
                self.garbage_bytes += 1
                at += 1
        self._buffer = buffer[at:]
        return frames

    def _valid_after(self, buffer: bytes, at: int) -> int:
        """Where a complete, valid frame starts behind the incomplete one at `at`; -1 if there is none."""
        end = len(buffer)
        for start in range(at + 1, end - 8):
            mark = buffer[start]
            if mark not in (V1_MARK, V2_MARK) or end - start < 12:
                continue
            header = 10 if mark == V2_MARK else 6
            signed = mark == V2_MARK and bool(buffer[start + 2] & 1)
            stop = start + header + buffer[start + 1] + 2
            total = stop + 13 * signed
            if total <= end and self._check(buffer, start, header, stop, total)[0] is not None:
                return start
        return -1

    @staticmethod
    def _check(buffer: bytes, at: int, header: int, stop: int, total: int) -> tuple[Frame | None, bool]:
        if header == 10:
            sequence, system, component = buffer[at + 4], buffer[at + 5], buffer[at + 6]
            id = buffer[at + 7] | buffer[at + 8] << 8 | buffer[at + 9] << 16
        else:
            sequence, system, component, id = buffer[at + 2], buffer[at + 3], buffer[at + 4], buffer[at + 5]
        message = MESSAGES.get(id)
        if message is None:
            return None, False
        crc = mcrf4xx(buffer[at + 1 : stop - 2] + bytes((message.crc_extra,)))
        if crc != buffer[stop - 2] | buffer[stop - 1] << 8:
            return None, True
        payload = buffer[at + header : stop - 2]
        return Frame(message, system, component, sequence, payload, buffer[at:total]), True
