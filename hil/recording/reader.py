"""Reads a recording back, also one whose writer was killed or whose bytes were damaged.

The file is read from front to back, record by record: the index at its end is what a killed run does not have. What
was flushed comes back; what is missing is said in `Recording.faults`.
"""

from __future__ import annotations

import heapq
import io
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema

from hil.contract.codec import CodecError, codec
from hil.contract.topics import TOPICS
from hil.recording.mcap_writer import LIBRARY, MAGIC
from hil.recording.recorder import PICTURES, PREFIX

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQII")
_RECORDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
}


class ReadError(ValueError):
    """The file is no recording of ours, or nothing in it can be read."""


class Raw(NamedTuple):
    """One message as bytes. `topic` is the file's: own topics start with /perch/, others are views."""

    log_ns: int
    topic: str
    sequence: int
    data: bytes


class Entry(NamedTuple):
    """One message of the contract; `log_ns` is when it was published."""

    log_ns: int
    topic: str
    message: Any


@dataclass(frozen=True, slots=True)
class _Chunk:
    offset: int  # of the compressed data in the file
    size: int
    compression: str
    uncompressed_size: int
    crc: int


class Recording:
    """A recording at `path` (a file, or a run folder holding run.mcap), scanned but not loaded.

    complete: the writer finished it. faults: what is missing or damaged, one line each, empty if nothing is.
    topics: topic -> schema name, for every topic in the file. metadata: tables of strings.
    Raises ReadError for a missing or empty file, random bytes, and a file without topics of ours.
    """

    def __init__(self, path: Path | str) -> None:
        path = Path(path)
        self.path = path / "run.mcap" if path.is_dir() else path
        self.complete = False
        self.faults: list[str] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: list[_Chunk] = []
        self._bad_chunks: set[int] = set()
        self._ours = False
        try:
            with self.path.open("rb") as file:
                self._scan(file, self.path.stat().st_size)
        except OSError as error:
            raise ReadError(f"{self.path}: cannot be read: {error.strerror}") from None
        self.topics = {c.topic: self._schema_name(c) for c in self._channels.values()}
        if not any(topic.startswith(PREFIX) for topic in self.topics):
            found = ", ".join(sorted(self.topics)[:5]) or "none"
            raise ReadError(f"{self.path}: an MCAP file, but not a recording of perch-hil (topics: {found})")

    def messages(self, topics: Iterable[str] | None = None) -> Iterator[Entry]:
        """Messages of `topics` (names of the contract, default all recorded), decoded, in the order of publication.

        Raises ReadError for a topic the contract does not list.
        """
        wanted = list(topics) if topics is not None else [t for t in TOPICS if PREFIX + t in self.topics]
        for topic in wanted:
            if topic not in TOPICS:
                raise ReadError(f"no topic {topic!r}; the contract has {', '.join(TOPICS)}")
        codecs = {PREFIX + topic: codec(TOPICS[topic].message) for topic in wanted}
        for raw in self.raw(codecs):
            try:
                yield Entry(raw.log_ns, raw.topic[len(PREFIX) :], codecs[raw.topic].decode(raw.data))
            except CodecError as error:
                self._fault(f"{raw.topic} at {raw.log_ns / 1e9:.3f} s: {error}")

    def raw(self, topics: Iterable[str] | None = None) -> Iterator[Raw]:
        """Messages of the file's `topics` (default all, views too) as bytes, in the order of publication."""
        wanted = None if topics is None else set(topics)
        ids = {i for i, c in self._channels.items() if wanted is None or c.topic in wanted}
        if not self._ours:  # rewritten by another tool: no promise about chunks
            return iter(sorted(self._lane(self._chunks, ids), key=lambda raw: raw.log_ns))
        # small messages and pictures lie in separate chunks that overlap in time: read each lane by itself, then merge
        lanes = [[c for c in self._chunks if c.compression]]
        if any(self._channels[i].topic.endswith(PICTURES) for i in ids):
            lanes.append([c for c in self._chunks if not c.compression])
        return heapq.merge(*(self._lane(chunks, ids) for chunks in lanes), key=lambda raw: raw.log_ns)

    def counts(self) -> dict[str, int]:
        """How many messages of each topic can be read. Reads the whole file."""
        counts = dict.fromkeys(self.topics, 0)
        for raw in self.raw():
            counts[raw.topic] += 1
        return counts

    def _lane(self, chunks: list[_Chunk], ids: set[int]) -> Iterator[Raw]:
        with self.path.open("rb") as file:
            for chunk in chunks:
                yield from self._chunk(file, chunk, ids)

    def _chunk(self, file: IO[bytes], chunk: _Chunk, ids: set[int]) -> Iterator[Raw]:
        file.seek(chunk.offset)
        data = file.read(chunk.size)
        try:
            data = _decompress(chunk, data)
        except (ValueError, RuntimeError, zstandard.ZstdError, MemoryError) as error:
            self._bad_chunk(chunk, str(error))
            return
        if chunk.crc and zlib.crc32(data) != chunk.crc:
            self._bad_chunk(chunk, "its checksum does not match")
            return
        at = 0
        while at + _HEAD.size <= len(data):
            opcode, length = _HEAD.unpack_from(data, at)
            at += _HEAD.size
            if at + length > len(data):
                self._bad_chunk(chunk, "it ends within a message")
                return
            if opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
                channel, sequence, log_ns, _ = _MESSAGE.unpack_from(data, at)
                if channel in ids:
                    yield Raw(log_ns, self._channels[channel].topic, sequence, data[at + _MESSAGE.size : at + length])
            at += length

    def _bad_chunk(self, chunk: _Chunk, why: str) -> None:
        if chunk.offset not in self._bad_chunks:
            self._bad_chunks.add(chunk.offset)
            self._fault(f"a block of {chunk.size} bytes at byte {chunk.offset} is damaged and was left out: {why}")

    def _fault(self, text: str) -> None:
        if text not in self.faults:
            self.faults.append(text)

    def _schema_name(self, channel: Channel) -> str:
        schema = self._schemas.get(channel.schema_id)
        return schema.name if schema else ""

    def _scan(self, file: IO[bytes], size: int) -> None:
        if size == 0:
            raise ReadError(f"{self.path}: is empty: the run ended before anything was written")
        if file.read(len(MAGIC)) != MAGIC:
            raise ReadError(f"{self.path}: is no MCAP recording (its first bytes are others)")
        while True:
            start = file.tell()
            head = file.read(_HEAD.size)
            if len(head) < _HEAD.size:
                if self.complete:
                    return
                self._fault(f"not finished: it stops at byte {start}, without the closing record")
                return
            opcode, length = _HEAD.unpack(head)
            if opcode == Opcode.FOOTER and self.complete:
                return
            if start + _HEAD.size + length > size:
                if self.complete:  # the index is damaged, which this reader does not need
                    return
                self._fault(f"cut off or damaged at byte {start}: the record there should go on for {length} bytes")
                return
            if opcode == Opcode.DATA_END:
                self.complete = True  # other tools list their channels only in chunks and in the index that follows
            try:
                self._record(file, opcode, length, start + _HEAD.size)
            except (McapError, struct.error, ValueError) as error:
                self._fault(f"the record at byte {start} is damaged and was left out: {error}")
            file.seek(start + _HEAD.size + length)

    def _record(self, file: IO[bytes], opcode: int, length: int, start: int) -> None:
        if opcode == Opcode.CHUNK:
            *_, uncompressed, crc, name_length = _CHUNK.unpack(file.read(_CHUNK.size))
            compression = file.read(min(name_length, 16)).decode("ascii")
            (stored,) = struct.unpack("<Q", file.read(8))
            if _CHUNK.size + name_length + 8 + stored != length:
                raise ValueError("its lengths contradict each other")
            if compression not in ("", "lz4", "zstd"):
                raise ValueError(f"its compression {compression!r} is unknown")
            self._chunks.append(_Chunk(start + length - stored, stored, compression, uncompressed, crc))
        elif opcode in _RECORDS:
            record = _RECORDS[opcode].read(ReadDataStream(io.BytesIO(file.read(length))))
            if isinstance(record, Schema):
                self._schemas.setdefault(record.id, record)
            elif isinstance(record, Channel):
                self._channels.setdefault(record.id, record)
            elif isinstance(record, Metadata):
                self.metadata[record.name] = record.metadata
            elif isinstance(record, Header):
                self._ours = record.library == LIBRARY
        elif opcode == Opcode.MESSAGE:
            self._fault("messages outside of chunks were left out: our recordings have none")


def _decompress(chunk: _Chunk, data: bytes) -> bytes:
    if chunk.compression == "zstd":
        return zstandard.decompress(data, chunk.uncompressed_size)
    if chunk.compression == "lz4":
        return lz4.frame.decompress(data)
    return data
