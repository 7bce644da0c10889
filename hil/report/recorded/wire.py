"""Decodes many protobuf messages of one kind into arrays at once; one by one they cost 7 us each.

Messages whose keys, lengths and varint sizes agree have their numbers at the same bytes, so that the first message
gives the positions for all (protobuf's wire format, proto3, packed repeated fields).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_VARINT, _FIXED64, _BYTES = 0, 1, 2
_MOST_LAYOUTS = 64  # of messages of one length; beyond, they are decoded one by one


class Span(NamedTuple):
    """Where a field's value lies in a message: bytes `start` to `end`."""

    kind: int
    start: int
    end: int


def layouts(data: bytes | bytearray, offsets: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, dict[int, Span]]]:
    """Groups of messages of one layout: (their indices (n,), their bytes (n, length), field number -> place).

    Message i is `data[offsets[i]:offsets[i + 1]]`. Raises ValueError if a message is damaged or they differ too much.
    """
    buffer, lengths = np.frombuffer(data, np.uint8), np.diff(offsets)
    groups = []
    for length in np.unique(lengths).tolist():
        left = np.flatnonzero(lengths == length)
        for _ in range(_MOST_LAYOUTS):
            if not len(left):
                break
            rows = buffer[offsets[left][:, None] + np.arange(length)]
            spans, fixed, varint = _walk(rows[0].tobytes())
            same = (rows[:, fixed] == rows[0, fixed]).all(axis=1)
            same &= ((rows[:, varint] & 0x80) == (rows[0, varint] & 0x80)).all(axis=1)
            groups.append((left[same], rows[same], spans))
            left = left[~same]
        if len(left):
            raise ValueError("too many layouts")
    return groups


def integers(rows: np.ndarray, span: Span) -> np.ndarray:
    """A varint field of messages of one layout, (n,) int64."""
    value = np.zeros(len(rows), dtype=np.uint64)
    for i in range(span.start, span.end):
        value |= (rows[:, i] & 0x7F).astype(np.uint64) << np.uint64(7 * (i - span.start))
    return value.view(np.int64)


def doubles(rows: np.ndarray, span: Span) -> np.ndarray:
    """A field of doubles, (n, k) float64; k is 1 for a single one."""
    return np.ascontiguousarray(rows[:, span.start : span.end]).view("<f8")


def _walk(message: bytes) -> tuple[dict[int, Span], list[int], list[int]]:
    """(field number -> place, bytes that make the layout, bytes of varint values) of one message."""
    spans: dict[int, Span] = {}
    fixed: list[int] = []
    varints: list[int] = []
    at = 0
    while at < len(message):
        start = at
        key, at = _varint(message, at)
        fixed += range(start, at)
        kind = key & 7
        start = at
        if kind == _VARINT:
            _, at = _varint(message, at)
            varints += range(start, at)
        elif kind == _FIXED64:
            at += 8
        elif kind == _BYTES:
            size, at = _varint(message, at)
            fixed += range(start, at)
            start, at = at, at + size
        else:
            raise ValueError(f"wire type {kind}")
        if at > len(message) or key >> 3 in spans:
            raise ValueError("damaged, or a field that is not packed")
        spans[key >> 3] = Span(kind, start, at)
    return spans, fixed, varints


def _varint(message: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while at < len(message) and shift < 70:
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
    raise ValueError("a number without an end")
