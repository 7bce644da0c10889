"""Reads a recording, also one whose writer was killed or whose bytes were damaged.

Every intact block is read. `Recording.faults` lists the damage, `Recording.missing` the lost messages, seconds and
topics.
"""

from __future__ import annotations

import heapq
import struct
from array import array
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel

from hil.contract.codec import CodecError, codec
from hil.contract.topics import TOPICS
from hil.recording.mcap_records import HEAD, Chunk
from hil.recording.mcap_scan import scan
from hil.recording.mcap_writer import MAGIC
from hil.recording.recorder import PICTURES, PREFIX

_MESSAGE = struct.Struct("<HIQQ")


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


class Packed(NamedTuple):
    """Messages of one topic: message i is `data[offsets[i]:offsets[i + 1]]`, published at `log_ns[i]`.

    `published_ns` also has those that were not kept.
    """

    published_ns: array[int]
    log_ns: array[int]
    data: bytearray
    offsets: array[int]


class Missing(NamedTuple):
    """Messages that the writer numbered and that cannot be read: between two times of publication (ns)."""

    topic: str
    messages: int
    start_ns: int
    end_ns: int

    def __str__(self) -> str:
        span = f"{self.start_ns / 1e9:.2f} and {self.end_ns / 1e9:.2f} s"
        return f"{self.topic.removeprefix(PREFIX)}: {self.messages} messages are missing between {span}"


class Recording:
    """A recording at `path` (a file, or a run folder holding run.mcap), scanned but not loaded.

    complete: the writer finished it. faults: what is missing or damaged, one line each, empty if nothing is.
    topics: topic -> schema name, for every topic in the file. metadata: tables of strings.
    Raises ReadError for a missing or empty file, random bytes, and a file without topics of ours.
    """

    def __init__(self, path: Path | str) -> None:
        path = Path(path)
        self.path = path / "run.mcap" if path.is_dir() else path
        self._bad_chunks: set[int] = set()
        try:
            with self.path.open("rb") as file:
                size = self.path.stat().st_size
                if size == 0:
                    raise ReadError(f"{self.path}: is empty: the run ended before anything was written")
                if file.read(len(MAGIC)) != MAGIC:
                    raise ReadError(f"{self.path}: is no MCAP recording (its first bytes are others)")
                found = scan(file, size)
        except OSError as error:
            raise ReadError(f"{self.path}: cannot be read: {error.strerror}") from None
        self.complete, self.faults, self.metadata = found.complete, found.faults, found.metadata
        self._schemas, self._channels, self._chunks = found.schemas, found.channels, found.chunks
        self._ours, self._statistics = found.ours, found.statistics
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
        lanes = []
        pictures = {i for i in ids if self._channels[i].topic.endswith(PICTURES)}
        if ids - pictures:
            lanes.append([c for c in self._chunks if c.compression])
        if pictures:
            lanes.append([c for c in self._chunks if not c.compression])
        if len(lanes) == 1:
            return self._lane(lanes[0], ids)  # a merge of one lane costs as much as reading it
        return heapq.merge(*(self._lane(chunks, ids) for chunks in lanes), key=lambda raw: raw.log_ns)

    @property
    def end_ns(self) -> int | None:
        """When the last message was published, None without an intact index."""
        return self._statistics.message_end_time if self._statistics else None

    def packed(self, topics: Iterable[str], *, spacing_ns: Mapping[str, int], until_ns: int) -> dict[str, Packed]:
        """The messages of the file's `topics` that have any, in the order of publication.

        Before `until_ns`, of a topic in `spacing_ns` only the first in each interval of that length is kept.
        """
        packed = {topic: Packed(array("q"), array("q"), bytearray(), array("q", [0])) for topic in topics}
        slots = dict.fromkeys(spacing_ns, -1)
        for log_ns, topic, _, data in self.raw(packed):
            one = packed[topic]
            one.published_ns.append(log_ns)
            if log_ns < until_ns and topic in slots:
                slot = log_ns // spacing_ns[topic]
                if slot == slots[topic]:
                    continue
                slots[topic] = slot
            one.log_ns.append(log_ns)
            one.data.extend(data)
            one.offsets.append(len(one.data))
        return {topic: one for topic, one in packed.items() if one.log_ns}

    def note(self, fault: str) -> None:
        """Add what a reader of the messages found to be damaged."""
        self._fault(fault)

    def counts(self) -> dict[str, int]:
        """How many messages of each topic can be read. Reads the whole file."""
        counts = dict.fromkeys(self.topics, 0)
        for raw in self.raw():
            counts[raw.topic] += 1
        return counts

    def missing(self) -> list[Missing]:
        """What is missing by the writer's numbering, a line for each gap of a topic. Reads the whole file.

        What a killed run had not written yet is in no count.
        """
        if not self._ours:
            return []
        gaps: list[Missing] = []
        last: dict[str, tuple[int, int]] = {}  # topic -> number and time of its newest message
        start_ns = self._statistics.message_start_time if self._statistics else 0
        for raw in self.raw():
            number, before_ns = last.get(raw.topic, (-1, start_ns))
            if raw.sequence > number + 1:
                gaps.append(Missing(raw.topic, raw.sequence - number - 1, before_ns, raw.log_ns))
            last[raw.topic] = (raw.sequence, raw.log_ns)
        if self._statistics:
            for channel, count in self._statistics.channel_message_counts.items():
                topic = self._channels[channel].topic if channel in self._channels else f"number {channel}"
                number, before_ns = last.get(topic, (-1, start_ns))
                if count > number + 1:
                    gaps.append(Missing(topic, count - number - 1, before_ns, self._statistics.message_end_time))
        return gaps

    def _lane(self, chunks: list[Chunk], ids: set[int]) -> Iterator[Raw]:
        with self.path.open("rb") as file:
            for chunk in chunks:
                yield from self._chunk(file, chunk, ids)

    def _chunk(self, file: IO[bytes], chunk: Chunk, ids: set[int]) -> Iterator[Raw]:
        file.seek(chunk.offset)
        try:
            data = chunk.unpack(file.read(chunk.size))
        except ValueError as error:
            self._bad_chunk(chunk, str(error))
            return
        at = 0
        while at + HEAD.size <= len(data):
            opcode, length = HEAD.unpack_from(data, at)
            at += HEAD.size
            if at + length > len(data):
                self._bad_chunk(chunk, "it ends within a message")
                return
            if opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
                channel, sequence, log_ns, _ = _MESSAGE.unpack_from(data, at)
                if channel in ids:
                    yield Raw(log_ns, self._channels[channel].topic, sequence, data[at + _MESSAGE.size : at + length])
                elif channel not in self._channels:
                    self._fault(f"messages of a topic that is not described (number {channel}) were left out")
            at += length

    def _bad_chunk(self, chunk: Chunk, why: str) -> None:
        if chunk.offset not in self._bad_chunks:
            self._bad_chunks.add(chunk.offset)
            self._fault(f"a block of {chunk.size} bytes at byte {chunk.offset} is damaged and was left out: {why}")

    def _fault(self, text: str) -> None:
        if text not in self.faults:
            self.faults.append(text)

    def _schema_name(self, channel: Channel) -> str:
        schema = self._schemas.get(channel.schema_id)
        return schema.name if schema else ""
