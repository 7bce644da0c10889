"""The records of an MCAP file that a reader needs, and the result of a scan."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Header, Metadata, MetadataIndex, Schema, Statistics

from hil.recording.mcap_writer import LIBRARY

HEAD = struct.Struct("<BQ")  # opcode and length of every record
CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, crc, length of the compression's name
DAMAGED = (McapError, struct.error, ValueError)  # what `parse` raises for a damaged record
RECORDS: dict[int, Any] = {
    Opcode.HEADER: Header, Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.METADATA: Metadata,
    Opcode.CHUNK_INDEX: ChunkIndex, Opcode.STATISTICS: Statistics, Opcode.METADATA_INDEX: MetadataIndex,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Chunk:
    """A block of messages, published from `start_ns` to `end_ns`. `offset` and `size`: its stored data in the file."""

    offset: int
    size: int
    compression: str
    uncompressed_size: int
    crc: int
    start_ns: int
    end_ns: int

    def unpack(self, stored: bytes) -> bytes:
        """The messages. Raises ValueError if the stored data is damaged."""
        try:
            data = _decompress(self, stored)
        except (ValueError, RuntimeError, zstandard.ZstdError, MemoryError) as error:
            raise ValueError(str(error)) from None
        if self.crc and zlib.crc32(data) != self.crc:
            raise ValueError("its checksum does not match")
        return data


@dataclass
class Found:
    """What a scan found. `complete`: the writer finished the file. `statistics`: None without an intact index."""

    complete: bool = False
    ours: bool = False  # written by `McapWriter`
    faults: list[str] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    chunks: list[Chunk] = field(default_factory=list)
    statistics: Statistics | None = None

    def take(self, record: Any) -> None:
        """Note a record that is no chunk; the first of one number counts."""
        if isinstance(record, Schema):
            self.schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            self.channels.setdefault(record.id, record)
        elif isinstance(record, Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, Header):
            self.ours = record.library == LIBRARY


def parse(opcode: int, data: bytes) -> Any:
    """The record in `data`. Raises one of DAMAGED."""
    return RECORDS[opcode].read(ReadDataStream(io.BytesIO(data)))


def _decompress(chunk: Chunk, data: bytes) -> bytes:
    if chunk.compression == "zstd":
        return zstandard.decompress(data, chunk.uncompressed_size)
    if chunk.compression == "lz4":
        return lz4.frame.decompress(data)
    return data
