"""Reads blocks and topics of an MCAP file from its index, which has a checksum, unlike the front's records."""

from __future__ import annotations

import struct
import zlib
from typing import IO, Any

from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Header, MetadataIndex, Schema, Statistics

from hil.recording.mcap_records import CHUNK, DAMAGED, HEAD, RECORDS, Chunk, Found, parse
from hil.recording.mcap_writer import MAGIC

_FOOTER = struct.Struct("<BQQQI")
_FOOTER_LENGTH = 20


def by_index(file: IO[bytes], size: int) -> Found | None:
    """The content of a file of `size` bytes by its index; None if there is none or its checksum does not match."""
    index = _read_index(file, size)
    if index is None:
        return None
    found = Found(complete=True)
    places = []
    for record in index:
        if isinstance(record, ChunkIndex):
            places.append(record)
        elif isinstance(record, Statistics):
            found.statistics = record
        else:
            found.take(record)
    first = min((place.chunk_start_offset for place in places), default=size)
    for place in places:
        found.chunks.append(_indexed_chunk(file, place))
    _compare_front(file, first, found)
    for place in index:
        if isinstance(place, MetadataIndex):
            _read_metadata(file, place, found)
    return found


def _read_index(file: IO[bytes], size: int) -> list[Any] | None:
    """The records of the summary, or None if there is none or its checksum does not match."""
    tail = _FOOTER.size + len(MAGIC)
    if size < len(MAGIC) + tail:
        return None
    file.seek(size - tail)
    footer = file.read(tail)
    opcode, length, start, _, crc = _FOOTER.unpack_from(footer)
    if footer[-len(MAGIC) :] != MAGIC or opcode != Opcode.FOOTER or length != _FOOTER_LENGTH:
        return None
    if not crc or not len(MAGIC) <= start <= size - tail:
        return None
    file.seek(start)
    summary = file.read(size - tail - start)
    if zlib.crc32(footer[: _FOOTER.size - 4], zlib.crc32(summary)) != crc:
        return None
    records, at = [], 0
    while at + HEAD.size <= len(summary):
        opcode, length = HEAD.unpack_from(summary, at)
        at += HEAD.size
        if opcode in RECORDS:
            try:
                records.append(parse(opcode, summary[at : at + length]))
            except DAMAGED:
                return None
        at += length
    has_chunks = any(isinstance(record, ChunkIndex) for record in records)
    counted = [record.message_count for record in records if isinstance(record, Statistics)]
    return records if counted and (has_chunks or not counted[0]) else None


def _indexed_chunk(file: IO[bytes], place: ChunkIndex) -> Chunk:
    file.seek(place.chunk_start_offset + HEAD.size + CHUNK.size - 8)
    head = file.read(4)
    crc = int.from_bytes(head, "little") if len(head) == 4 else 1
    offset = place.chunk_start_offset + place.chunk_length - place.compressed_size
    return Chunk(
        offset, place.compressed_size, place.compression, place.uncompressed_size, crc,
        place.message_start_time, place.message_end_time,
    )  # fmt: skip


def _compare_front(file: IO[bytes], end: int, found: Found) -> None:
    """Read the header; note where schemas and channels before the first block (at byte `end`) contradict the index."""
    wanted = {_key(record) for record in (*found.schemas.values(), *found.channels.values())}
    seen, at = set(), len(MAGIC)
    while at + HEAD.size <= end:
        file.seek(at)
        opcode, length = HEAD.unpack(file.read(HEAD.size))
        if at + HEAD.size + length > end:
            break
        if opcode in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL):
            try:
                record = parse(opcode, file.read(length))
            except DAMAGED:
                record = None
            if isinstance(record, Header):
                found.take(record)
            elif record is not None:
                seen.add(_key(record))
        at += HEAD.size + length
    if found.ours and seen != wanted:
        found.faults.append("the topics' descriptions at its front contradict its index: the index was used")


def _read_metadata(file: IO[bytes], place: MetadataIndex, found: Found) -> None:
    try:
        file.seek(place.offset)
        opcode, length = HEAD.unpack(file.read(HEAD.size))
        if opcode != Opcode.METADATA or HEAD.size + length != place.length:
            raise ValueError("another record stands there")
        found.take(parse(opcode, file.read(length)))
    except DAMAGED as error:
        found.faults.append(f"the table {place.name!r} at byte {place.offset} is damaged and was left out: {error}")


def _key(record: Any) -> tuple[Any, ...]:
    return (record.id, record.name, record.data) if isinstance(record, Schema) else (record.id, record.topic)
