"""The messages of one chunk as arrays: one compiled pass finds where each lies in the chunk's bytes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode

from kernel.jit import njit

_MESSAGE = int(Opcode.MESSAGE)
_RECORD, _HEAD = 9, 22  # bytes: opcode and length of a record; channel, sequence and two times of a message


class Block(NamedTuple):
    """Messages in the order of the file: message i is `data[start[i]:end[i]]`, published at `log_ns[i]`."""

    data: np.ndarray  # uint8
    channel: np.ndarray  # (n,) int64, as the others
    sequence: np.ndarray
    log_ns: np.ndarray
    start: np.ndarray
    end: np.ndarray

    def chosen(self, rows: np.ndarray) -> Block:
        """The messages `rows` (indices, or a mask)."""
        return Block(self.data, *(part[rows] for part in self[1:]))

    def packed(self) -> tuple[np.ndarray, np.ndarray]:
        """The messages one after the other, uint8, and where each begins, with the end, (n + 1,) int64."""
        offsets = np.zeros(len(self.start) + 1, dtype=np.int64)
        np.cumsum(self.end - self.start, out=offsets[1:])
        return gather(self.data, self.start, self.end), offsets

    def compact(self) -> Block:
        """The same messages without the bytes between them."""
        data, offsets = self.packed()
        return Block(readonly(data), self.channel, self.sequence, self.log_ns, offsets[:-1], offsets[1:])


def split(data: bytes) -> tuple[Block, bool]:
    """The messages of a chunk, and whether its last record is whole."""
    array = readonly(data)
    table = np.empty((5, _records(array)), dtype=np.int64)
    count, whole = _walk(array, table)
    return Block(array, *table[:, :count]), bool(whole)


def joined(blocks: Sequence[Block]) -> Block:
    """One block of all messages, in the order of publication."""
    parts = [block.packed() for block in blocks]
    starts = np.cumsum([0, *(len(data) for data, _ in parts)])
    data = np.concatenate([data for data, _ in parts]) if parts else np.empty(0, dtype=np.uint8)
    begin = [offsets[:-1] + at for (_, offsets), at in zip(parts, starts, strict=False)]
    end = [offsets[1:] + at for (_, offsets), at in zip(parts, starts, strict=False)]
    columns = [[getattr(block, name) for block in blocks] for name in ("channel", "sequence", "log_ns")]
    whole = [np.concatenate(column) if column else np.empty(0, dtype=np.int64) for column in (*columns, begin, end)]
    one = Block(readonly(data), *whole)
    return one.chosen(np.argsort(one.log_ns, kind="stable"))


def readonly(data: bytes | bytearray | np.ndarray) -> np.ndarray:
    """Bytes as the kernels take them: uint8 that cannot be written to."""
    array = np.frombuffer(data, dtype=np.uint8)
    array.flags.writeable = False
    return array


def gather(data: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """`data[start[i]:end[i]]` of all i, one after the other, uint8."""
    out = np.empty(int((end - start).sum()), dtype=np.uint8)
    _copy(data, start, end, out)
    return out


@njit
def _copy(data: np.ndarray, start: np.ndarray, end: np.ndarray, out: np.ndarray) -> None:
    at = 0
    for i in range(len(start)):
        for k in range(start[i], end[i]):
            out[at] = data[k]
            at += 1


@njit
def _integer(data: np.ndarray, at: int, size: int) -> int:
    """`size` bytes from `at` on, the lowest first; eight bytes may give a negative number."""
    value: Any = np.int64(0)
    for k in range(size):
        value |= np.int64(data[at + k]) << np.int64(8 * k)
    return value


@njit
def _records(data: np.ndarray) -> int:
    """How many records begin in `data`."""
    at, count = 0, 0
    while at + _RECORD <= len(data):
        length = _integer(data, at + 1, 8)
        count += 1
        if length < 0 or length > len(data) - at - _RECORD:
            break
        at += _RECORD + length
    return count


@njit
def _walk(data: np.ndarray, table: np.ndarray) -> tuple[int, bool]:
    """Fill the rows of `table` (5, n): channel, sequence, log time, start, end; (messages, whether all is whole)."""
    at, count = 0, 0
    while at + _RECORD <= len(data):
        length = _integer(data, at + 1, 8)
        begin = at + _RECORD
        if length < 0 or length > len(data) - begin:
            return count, False
        if data[at] == _MESSAGE and length >= _HEAD:
            table[0, count] = _integer(data, begin, 2)
            table[1, count] = _integer(data, begin + 2, 4)
            table[2, count] = _integer(data, begin + 6, 8)
            table[3, count] = begin + _HEAD
            table[4, count] = begin + length
            count += 1
        at = begin + length
    return count, True
