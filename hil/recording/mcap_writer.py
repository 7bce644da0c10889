"""Writes an MCAP file in lanes: small messages in compressed chunks, pictures in chunks of their own.

A reader can skip the pictures, a message costs a few us (in the `mcap` package's writer 20-30 us, with all in one
chunk), and equal messages give equal bytes, independent of clock and machine.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter, defaultdict
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, DataEnd, Footer, Header, Metadata, MetadataIndex, Schema, Statistics
from mcap.records import SummaryOffset as Offset

LIBRARY = "perch-hil"
MAGIC = b"\x89MCAP0\r\n"
_OPCODE = int(Opcode.MESSAGE)
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_CHUNK = struct.Struct("<BQQQQII")  # opcode, length, start, end, uncompressed size, crc, length of compression's name
_FLUSH_NS = 1_000_000_000


class Lane:
    """Messages waiting to become one chunk."""

    def __init__(self, compression: str, limit_bytes: int) -> None:
        self.compression, self.limit_bytes = compression, limit_bytes
        self.buffer = bytearray()
        self.index: dict[int, list[int]] = defaultdict(list)  # channel -> flat list of log time, offset
        self.start_ns = self.end_ns = 0


class McapWriter:
    """Writes `path` (which must not exist). Chunks are flushed to the operating system when they span one second of
    log time or fill up, so that a killed process loses at most that; `close` adds the index that viewers like.

    After a write that failed with an OSError the file ends with its last whole record, and nothing more is written."""

    def __init__(self, path: Path, library: str = LIBRARY) -> None:
        self._file = path.open("xb", buffering=0)
        self._failed = False
        self._zstd = zstandard.ZstdCompressor(level=1)  # as quick as lz4 on these messages and a quarter smaller
        self.lanes = {"small": Lane("zstd", 1 << 20), "pictures": Lane("", 4 << 20)}
        self._lane_of: list[Lane] = []
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []
        self._sequences: list[int] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._write(MAGIC + _record(Header(profile="", library=library)))

    def channel(self, topic: str, schema_name: str, schema: bytes, lane: str = "small") -> int:
        """Register a topic of protobuf messages; returns the channel's number for `add`."""
        if schema_name not in self._schemas:
            self._schemas[schema_name] = Schema(
                id=len(self._schemas) + 1, data=schema, encoding="protobuf", name=schema_name
            )
            self._write(_record(self._schemas[schema_name]))
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding="protobuf",
            metadata={},
            schema_id=self._schemas[schema_name].id,
        )
        self._write(_record(channel))
        self._channels.append(channel)
        self._sequences.append(0)
        self._lane_of.append(self.lanes[lane])
        return channel.id

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """A table of strings beside the messages."""
        record = _record(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(offset=self._file.tell(), length=len(record), name=name))
        self._write(record)

    def add(self, channel: int, log_ns: int, data: bytes) -> None:
        """Append a message. Log times of one channel must not decrease."""
        lane = self._lane_of[channel - 1]
        buffer = lane.buffer
        at = len(buffer)
        if not at:
            lane.start_ns = lane.end_ns = log_ns
        elif log_ns - lane.start_ns >= _FLUSH_NS or at >= lane.limit_bytes:
            self._end_chunk(lane)
            buffer, at = lane.buffer, 0
            lane.start_ns = lane.end_ns = log_ns
        sequence = self._sequences[channel - 1]
        # in one piece, then counted: Ctrl-C between two statements must not leave half a message
        buffer += _MESSAGE.pack(_OPCODE, 22 + len(data), channel, sequence, log_ns, log_ns) + data
        self._sequences[channel - 1] = sequence + 1
        lane.index[channel] += log_ns, at
        if log_ns > lane.end_ns:
            lane.end_ns = log_ns

    def flush(self) -> None:
        """Write everything so far to the operating system."""
        for lane in self.lanes.values():
            self._end_chunk(lane)

    def close(self) -> None:
        """Flush, write the summary and close. Safe to call twice, and after a write that failed."""
        if self._file.closed:
            return
        try:
            if not self._failed:
                self.flush()
                self._write(_record(DataEnd(data_section_crc=0)))
                self._write(self._summary(self._file.tell()))
        finally:
            self._file.close()

    def counts(self) -> dict[str, int]:
        """Messages so far, by topic."""
        return {c.topic: n for c, n in zip(self._channels, self._sequences, strict=True)}

    def _write(self, data: bytes) -> None:
        if self._failed:
            return
        at, rest = self._file.tell(), memoryview(data)
        try:
            while rest:  # of a disk that fills up a part is taken first
                rest = rest[self._file.write(rest) :]
        except OSError:
            self._failed = True
            with suppress(OSError):
                self._file.truncate(at)
            raise

    def _end_chunk(self, lane: Lane) -> None:
        if not lane.buffer:
            return
        raw, index = bytes(lane.buffer), lane.index
        # before writing: an interruption must not write it twice
        lane.buffer, lane.index = bytearray(), defaultdict(list)
        stored = self._zstd.compress(raw) if lane.compression else raw
        name = lane.compression.encode()
        head = _CHUNK.pack(
            Opcode.CHUNK,
            40 + len(name) + len(stored),
            lane.start_ns,
            lane.end_ns,
            len(raw),
            zlib.crc32(raw),
            len(name),
        )
        start = self._file.tell()
        record = b"".join((head, name, struct.pack("<Q", len(stored)), stored))
        indices, offsets = bytearray(), {}
        for channel, entries in index.items():
            offsets[channel] = start + len(record) + len(indices)
            indices += struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + 8 * len(entries), channel, 8 * len(entries))
            indices += struct.pack(f"<{len(entries)}Q", *entries)
        self._write(record + indices)
        self._chunks.append(
            ChunkIndex(
                chunk_length=len(record),
                chunk_start_offset=start,
                compression=lane.compression,
                compressed_size=len(stored),
                message_end_time=lane.end_ns,
                message_index_length=len(indices),
                message_index_offsets=offsets,
                message_start_time=lane.start_ns,
                uncompressed_size=len(raw),
            )
        )

    def _summary(self, start: int) -> bytes:
        counts = Counter({c.id: n for c, n in zip(self._channels, self._sequences, strict=True) if n})
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=counts,
            chunk_count=len(self._chunks),
            message_count=counts.total(),
            metadata_count=len(self._metadata),
            message_start_time=min((c.message_start_time for c in self._chunks), default=0),
            message_end_time=max((c.message_end_time for c in self._chunks), default=0),
            schema_count=len(self._schemas),
        )
        groups = {
            Opcode.SCHEMA: list(self._schemas.values()),
            Opcode.CHANNEL: self._channels,
            Opcode.STATISTICS: [statistics],
            Opcode.CHUNK_INDEX: self._chunks,
            Opcode.METADATA_INDEX: self._metadata,
        }
        body, offsets = b"", b""
        for opcode, records in groups.items():
            group = b"".join(map(_record, records))
            if group:
                place = Offset(group_opcode=opcode, group_start=start + len(body), group_length=len(group))
                offsets += _record(place)
                body += group
        summary = body + offsets
        footer = _record(Footer(summary_start=start, summary_offset_start=start + len(body), summary_crc=0))
        crc = zlib.crc32(footer[:-4], zlib.crc32(summary))
        return summary + footer[:-4] + struct.pack("<I", crc) + MAGIC


def _record(record) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
