"""The messages that PX4 v1.17 and its clients exchange: pymavlink's tables and the messages that they lack, as structs.

`MessageType` lays a message's fields out as they lie on the wire; `codec.py` puts frames around them.
"""

from __future__ import annotations

import struct
from collections import namedtuple
from collections.abc import Sequence
from functools import cached_property
from operator import itemgetter
from typing import Any

from vehicle.px4.protocol import mavlink

LETTERS = {"char": "s", "uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I"} | {
    "int32_t": "i",
    "float": "f",
    "uint64_t": "Q",
    "int64_t": "q",
    "double": "d",
}


class MessageType:
    """One message of the dialect: its fields in definition order and how they lie on the wire."""

    def __init__(self, name: str, id: int, crc_extra: int, fields: Sequence[tuple[str, str, int]], wire: Sequence[int]):
        """`fields`: (name, type, array length or 0) in definition order; `wire`: their indices in wire order."""
        self.name, self.id, self.crc_extra = name, id, crc_extra
        self.field_names = tuple(f[0] for f in fields)
        self.Fields: Any = namedtuple(name, self.field_names)
        self._wire = tuple(wire)
        parts = []
        for i in self._wire:
            _, kind, length = fields[i]
            parts.append(f"{length or 1}s" if kind == "char" else f"{length or ''}{LETTERS[kind]}")
        self._struct = struct.Struct("<" + "".join(parts))
        self.size = self._struct.size
        self._arrays = [(i, fields[i][2]) for i in self._wire if fields[i][2] and fields[i][1] != "char"]
        self._texts = {i for i in self._wire if fields[i][1] == "char"}
        self._fields = tuple(fields)
        self._in_order = list(self._wire) == list(range(len(fields)))
        self._reorder = itemgetter(*self._wire) if len(self._wire) > 1 else (lambda values: (values[self._wire[0]],))

    def payload(self, values: Sequence[Any]) -> bytes:
        """Whole payload as it lies on the wire, from values in definition order."""
        if self._arrays or self._texts:
            flat: list[Any] = []
            for i in self._wire:
                if i in self._texts:
                    flat.append(values[i].encode() if isinstance(values[i], str) else values[i])
                elif self._fields[i][2]:
                    flat.extend(values[i])
                else:
                    flat.append(values[i])
            data = self._struct.pack(*flat)
        else:
            data = self._struct.pack(*(values if self._in_order else self._reorder(values)))
        return data

    def decode(self, payload: bytes) -> Any:
        """Fields as a named tuple; arrays are tuples, texts str. A cut-off payload is filled with zeros."""
        size = self._struct.size
        flat = self._struct.unpack(payload[:size].ljust(size, b"\0"))
        if not (self._arrays or self._texts):
            if self._in_order:
                return self.Fields(*flat)
            values: list[Any] = [None] * len(flat)
            for position, i in enumerate(self._wire):
                values[i] = flat[position]
            return self.Fields(*values)
        values, at = [None] * len(self._fields), 0
        for i in self._wire:
            length = self._fields[i][2]
            if i in self._texts:
                values[i] = flat[at].split(b"\0", 1)[0].decode("ascii", "replace")
                at += 1
            elif length:
                values[i] = flat[at : at + length]
                at += length
            else:
                values[i] = flat[at]
                at += 1
        return self.Fields(*values)


def _from_dialect(cls: Any) -> MessageType:
    lengths = dict(zip(cls.ordered_fieldnames, cls.array_lengths, strict=True))  # pymavlink lists these in wire order
    fields = [(name, kind, lengths[name]) for name, kind in zip(cls.fieldnames, cls.fieldtypes, strict=True)]
    wire = [cls.fieldnames.index(name) for name in cls.ordered_fieldnames]
    return MessageType(cls.msgname, cls.id, cls.crc_extra, fields, wire)


# PX4 v1.17 sends these; pymavlink's dialects of this version do not know them, or not with all their fields.
_EXTRA = (
    MessageType(
        "TIMESYNC",
        111,
        34,
        [
            ("tc1", "int64_t", 0),
            ("ts1", "int64_t", 0),
            ("target_system", "uint8_t", 0),
            ("target_component", "uint8_t", 0),
        ],
        (0, 1, 2, 3),
    ),
    MessageType(
        "LINK_NODE_STATUS",
        8,
        117,
        [
            ("timestamp", "uint64_t", 0),
            ("tx_buf", "uint8_t", 0),
            ("rx_buf", "uint8_t", 0),
            ("tx_rate", "uint32_t", 0),
            ("rx_rate", "uint32_t", 0),
            ("rx_parse_err", "uint16_t", 0),
            ("tx_overflows", "uint16_t", 0),
            ("rx_overflows", "uint16_t", 0),
            ("messages_sent", "uint32_t", 0),
            ("messages_received", "uint32_t", 0),
            ("messages_lost", "uint32_t", 0),
        ],
        (0, 3, 4, 8, 9, 10, 5, 6, 7, 1, 2),
    ),
    MessageType(
        "COMPONENT_METADATA",
        397,
        182,
        [("time_boot_ms", "uint32_t", 0), ("file_crc", "uint32_t", 0), ("uri", "char", 100)],
        (0, 1, 2),
    ),
    MessageType(
        "PROTOCOL_VERSION",
        300,
        217,
        [
            ("version", "uint16_t", 0),
            ("min_version", "uint16_t", 0),
            ("max_version", "uint16_t", 0),
            ("spec_version_hash", "uint8_t", 8),
            ("library_version_hash", "uint8_t", 8),
        ],
        (0, 1, 2, 3, 4),
    ),
    MessageType(
        "TIME_ESTIMATE_TO_TARGET",
        380,
        232,
        [
            ("safe_return", "int32_t", 0),
            ("land", "int32_t", 0),
            ("mission_next_item", "int32_t", 0),
            ("mission_end", "int32_t", 0),
            ("commanded_action", "int32_t", 0),
        ],
        (0, 1, 2, 3, 4),
    ),
    MessageType(
        "EVENT",
        410,
        160,
        [
            ("destination_component", "uint8_t", 0),
            ("destination_system", "uint8_t", 0),
            ("id", "uint32_t", 0),
            ("event_time_boot_ms", "uint32_t", 0),
            ("sequence", "uint16_t", 0),
            ("log_levels", "uint8_t", 0),
            ("arguments", "uint8_t", 40),
        ],
        (2, 3, 4, 0, 1, 5, 6),
    ),
    MessageType("CURRENT_EVENT_SEQUENCE", 411, 106, [("sequence", "uint16_t", 0), ("flags", "uint8_t", 0)], (0, 1)),
)


class _Messages:
    """The dialect's messages, built when first asked for (there are some 400)."""

    def __init__(self) -> None:
        self._by_id: dict[int, MessageType | None] = {t.id: t for t in _EXTRA}

    @cached_property
    def _ids(self) -> dict[str, int]:
        known = {cls.msgname: id for id, cls in mavlink.mavlink_map.items()}
        return known | {t.name: t.id for t in _EXTRA}

    def get(self, id: int) -> MessageType | None:
        """The message of that id, or None if the dialect does not know it."""
        if id not in self._by_id:
            cls = mavlink.mavlink_map.get(id)
            self._by_id[id] = _from_dialect(cls) if cls else None
        return self._by_id[id]

    def __getitem__(self, name: str) -> MessageType:
        """The message of that name. Raises KeyError."""
        found = self.get(self._ids[name])
        assert found is not None
        return found


MESSAGES = _Messages()
