"""Finds the blocks of an MCAP file: by its index if that is intact, else record by record from the front.

Where the front contradicts itself (a damaged length), the scan continues at the next block with a matching checksum.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from typing import IO

from mcap.opcode import Opcode

from hil.recording.mcap_index import by_index
from hil.recording.mcap_records import CHUNK, DAMAGED, HEAD, RECORDS, Chunk, Found, parse
from hil.recording.mcap_writer import MAGIC

_INDEX = struct.Struct("<HI")
_COMPRESSIONS = {"": 0, "lz4": 3, "zstd": 4}
_KNOWN = set(Opcode)
_CANDIDATE = re.compile(rb"\x06.{4}\x00{4}", re.DOTALL)  # a chunk's opcode and a length below 4 GiB


def scan(file: IO[bytes], size: int) -> Found:
    """Scan `file` of `size` bytes, which begins with MCAP's magic bytes. Raises OSError."""
    return by_index(file, size) or _scan_front(file, size)


def _scan_front(file: IO[bytes], size: int) -> Found:
    found, at, before = Found(), len(MAGIC), len(MAGIC)
    while True:
        if size - at < HEAD.size:
            if not found.complete:
                found.faults.append(f"not finished: it stops at byte {at}, without the closing record")
            return found
        file.seek(at)
        opcode, length = HEAD.unpack(file.read(HEAD.size))
        if found.complete and (opcode == Opcode.FOOTER or at + HEAD.size + length > size):
            if found.ours:
                found.faults.append("its index is damaged: it was read from front to back")
            return found
        why = _contradiction(file, opcode, length, at, size)
        if why:
            next_at = _resynchronise(file, before + 1, size, {c.offset for c in found.chunks})
            text = f"damaged at byte {at}: {why}" if next_at else f"cut off or damaged at byte {at}: {why}"
            found.faults.append(f"{text}; it goes on at byte {next_at}" if next_at else text)
            if next_at is None:
                return found
            at = before = next_at
            continue
        if opcode == Opcode.DATA_END:
            found.complete = True  # other tools list their channels only in chunks and in the index that follows
        elif opcode == Opcode.CHUNK:
            chunk = _chunk(file, at, length)
            if chunk is not None:
                found.chunks.append(chunk)
        elif opcode == Opcode.MESSAGE:
            found.faults.append("messages outside of chunks were left out: our recordings have none")
        elif opcode in RECORDS:
            file.seek(at + HEAD.size)
            try:
                found.take(parse(opcode, file.read(length)))
            except DAMAGED as error:
                found.faults.append(f"the record at byte {at} is damaged and was left out: {error}")
        before, at = at, at + HEAD.size + length


def _contradiction(file: IO[bytes], opcode: int, length: int, at: int, size: int) -> str:
    """Why the record at byte `at` cannot be one, empty if it can; the file stands behind the record's head."""
    if at + HEAD.size + length > size:
        return f"the record there should go on for {length} bytes"
    if opcode not in _KNOWN:
        return f"there is no record of kind {opcode}"
    if opcode == Opcode.CHUNK and _chunk(file, at, length) is None:
        return "the lengths of the block there contradict each other"
    if opcode == Opcode.MESSAGE_INDEX and (
        length < _INDEX.size or _INDEX.unpack(file.read(_INDEX.size))[1] + 6 != length
    ):
        return "the lengths of the index there contradict each other"
    return ""


def _chunk(file: IO[bytes], at: int, length: int) -> Chunk | None:
    """The block at byte `at`, None if its lengths contradict each other."""
    file.seek(at + HEAD.size)
    head = file.read(CHUNK.size + 12)
    if len(head) < CHUNK.size + 8:
        return None
    start_ns, end_ns, uncompressed, crc, name_length = CHUNK.unpack_from(head)
    name = head[CHUNK.size : CHUNK.size + min(name_length, 4)].decode("ascii", "replace")
    if _COMPRESSIONS.get(name) != name_length or start_ns > end_ns:
        return None
    (stored,) = struct.unpack_from("<Q", head.ljust(CHUNK.size + 12, b"\0"), CHUNK.size + name_length)
    if CHUNK.size + name_length + 8 + stored != length:
        return None
    return Chunk(at + HEAD.size + length - stored, stored, name, uncompressed, crc, start_ns, end_ns)


def _resynchronise(file: IO[bytes], start: int, size: int, known: set[int]) -> int | None:
    """Where from byte `start` on the next block begins whose checksum matches and that is not among the `known`."""
    for at in _candidates(file, start):
        file.seek(at)
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        _, length = HEAD.unpack(head)
        if at + HEAD.size + length > size:
            continue
        chunk = _chunk(file, at, length)
        if chunk is None or chunk.offset in known or not chunk.crc:
            continue
        file.seek(chunk.offset)
        try:
            chunk.unpack(file.read(chunk.size))
        except ValueError:
            continue
        return at
    return None


def _candidates(file: IO[bytes], start: int, window: int = 1 << 22) -> Iterator[int]:
    """Byte positions from `start` on that look like a block's head, read in windows that overlap by one head."""
    while True:
        file.seek(start)
        data = file.read(window + HEAD.size)
        for match in _CANDIDATE.finditer(data):
            if match.start() < window:
                yield start + match.start()
        if len(data) <= window:
            return
        start += window
