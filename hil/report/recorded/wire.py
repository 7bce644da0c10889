"""Fields of many protobuf messages of one kind as arrays: one by one they cost 7 us a message.

Protobuf's wire format, proto3, as `hil/contract/codec.py` writes it: each field once, repeated numbers packed. What is
read here has passed `sound`; a message that has not is decoded and encoded again, or is damaged.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kernel.jit import njit

# How a field is written: its wire type, and what `sound` asks of it.
NUMBER, DOUBLE, TEXT, BYTES, DOUBLES, NUMBERS, OTHER = range(7)
_VARINT, _FIXED64, _LENGTH, _FIXED32 = 0, 1, 2, 5


@njit
def sound(data: np.ndarray, offsets: np.ndarray, kinds: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """Which messages (n,) can be read by the functions below: message i is `data[offsets[i]:offsets[i + 1]]`.

    `kinds[k]` is how field k is written, `widths[k]` how many doubles it holds, 0: any number. Texts that are not
    ASCII, and repeated texts, are left to protobuf.
    """
    good = np.ones(len(offsets) - 1, dtype=np.bool_)
    seen = np.zeros(len(kinds), dtype=np.int64)
    for i in range(len(good)):
        at, end = offsets[i], offsets[i + 1]
        while at < end:
            number, wire, start, at = _field(data, at, end)
            if at < 0:
                good[i] = False
                break
            if number >= len(kinds):
                continue
            good[i] &= seen[number] != i + 1 and _fits(data, start, at, wire, kinds[number], widths[number])
            seen[number] = i + 1
    return good


@njit
def places(data: np.ndarray, offsets: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the value of field `number` begins and ends in `data`, (n,) each; equal where it is absent."""
    n = len(offsets) - 1
    start, stop = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    for i in range(n):
        at, end = offsets[i], offsets[i + 1]
        while 0 <= at < end:
            found, _, begin, at = _field(data, at, end)
            if at >= 0 and found == number:
                start[i], stop[i] = begin, at
                break
    return start, stop


@njit
def integers(data: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """A field of whole numbers, (n,) int64; 0 where it is absent."""
    out = np.zeros(len(start), dtype=np.int64)
    for i in range(len(start)):
        out[i] = _varint(data, start[i], end[i])[0] if end[i] > start[i] else 0
    return out


@njit
def counts(data: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """How many whole numbers a repeated field holds, (n,) int64."""
    out = np.zeros(len(start), dtype=np.int64)
    for i in range(len(start)):
        for at in range(start[i], end[i]):
            out[i] += data[at] < 0x80
    return out


@njit
def _fits(data: np.ndarray, start: int, end: int, wire: int, kind: int, width: int) -> bool:
    """Whether the value at `start` to `end` is one of `kind`."""
    if kind == NUMBER:
        return wire == _VARINT
    if kind == DOUBLE:
        return wire == _FIXED64
    if wire != _LENGTH:
        return False
    if kind == TEXT:
        for at in range(start, end):
            if data[at] >= 0x80:
                return False
    if kind == NUMBERS and end > start and data[end - 1] >= 0x80:
        return False
    if kind == DOUBLES and ((end - start) % 8 != 0 or (width > 0 and end - start != 8 * width)):
        return False
    return kind != OTHER


@njit
def _field(data: np.ndarray, at: int, end: int) -> tuple[int, int, int, int]:
    """(number, wire type, start, end) of the field whose key stands at `at`; the end is -1 if it is damaged."""
    key, start = _varint(data, at, end)
    wire, stop = key & 7, -1
    if start < 0 or key < 8:
        return 0, 0, 0, -1
    if wire == _VARINT:
        stop = _varint(data, start, end)[1]
    elif wire == _FIXED64:
        stop = start + 8
    elif wire == _FIXED32:
        stop = start + 4
    elif wire == _LENGTH:
        size, start = _varint(data, start, end)
        if start >= 0 and 0 <= size <= end - start:
            stop = start + size
    return key >> 3, wire, start, stop if stop <= end else -1


@njit
def _varint(data: np.ndarray, at: int, end: int) -> tuple[int, int]:
    """The number at `at` and where it ends, -1 if it does not before `end` or is longer than ten bytes."""
    value: Any = np.int64(0)
    for k in range(min(10, end - at)):
        byte = np.int64(data[at + k])
        value |= (byte & 0x7F) << np.int64(7 * k)
        if byte < 0x80:
            return value, at + k + 1
    return value, -1
