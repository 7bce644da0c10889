"""Reads a recording, also one whose writer was killed or whose bytes were damaged.

Every intact block is read. `Recording.faults` lists the damage, `Recording.missing` the lost messages, seconds and
topics.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.records import Channel

from hil.contract.codec import CodecError, codec
from hil.contract.topics import TOPICS
from hil.recording.blocks import Block, joined, split
from hil.recording.mcap_records import Chunk
from hil.recording.mcap_scan import scan
from hil.recording.mcap_writer import MAGIC
from hil.recording.recorder import PICTURES, PREFIX

_FOREVER_NS = 2**64
_BLOCK_BYTES = 4 << 20  # of chunks that are read as one block: each numpy call costs as much as a hundred messages


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

    def raw(
        self, topics: Iterable[str] | None = None, *, start_ns: int = 0, end_ns: int = _FOREVER_NS
    ) -> Iterator[Raw]:
        """Messages of the file's `topics` (default all, views too) as bytes, in the order of publication.

        Only those published from `start_ns` to `end_ns`, both included.
        """
        lanes = [(self._raw(block) for block in lane) for lane in self._lanes(topics, start_ns, end_ns)]
        each = [(raw for block in lane for raw in block) for lane in lanes]
        # a merge of one lane costs as much as reading it
        return each[0] if len(each) == 1 else heapq.merge(*each, key=lambda raw: raw.log_ns)

    def blocks(
        self, topics: Iterable[str] | None = None, *, start_ns: int = 0, end_ns: int = _FOREVER_NS
    ) -> Iterator[Block]:
        """The same as arrays, some chunks at a time: pictures come after all small messages."""
        for lane in self._lanes(topics, start_ns, end_ns):
            waiting: list[Block] = []
            for block in lane:
                waiting.append(block)
                if sum(len(one.data) for one in waiting) >= _BLOCK_BYTES:
                    yield joined(waiting)
                    waiting = []
            if waiting:
                yield joined(waiting)

    def by_topic(self, block: Block) -> dict[str, Block]:
        """The messages of each topic in `block`."""
        found: dict[str, list[int]] = {}
        for channel in np.unique(block.channel).tolist():
            found.setdefault(self._channels[channel].topic, []).append(channel)
        return {
            topic: block.chosen(block.channel == ids[0] if len(ids) == 1 else np.isin(block.channel, ids))
            for topic, ids in found.items()
        }

    @property
    def end_ns(self) -> int | None:
        """When the last message was published, None without an intact index."""
        return self._statistics.message_end_time if self._statistics else None

    def note(self, fault: str) -> None:
        """Add what a reader of the messages found to be damaged."""
        self._fault(fault)

    def counts(self) -> dict[str, int]:
        """How many messages of each topic can be read. Reads the whole file."""
        counts = dict.fromkeys(self.topics, 0)
        for block in self.blocks():
            for topic, rows in self.by_topic(block).items():
                counts[topic] += len(rows.log_ns)
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
        for block in self.blocks():
            for topic, rows in self.by_topic(block).items():
                number, before_ns = last.get(topic, (-1, start_ns))
                steps = np.diff(rows.sequence, prepend=number)
                times = np.concatenate([[before_ns], rows.log_ns])
                for i in np.flatnonzero(steps > 1).tolist():
                    gaps.append(Missing(topic, int(steps[i]) - 1, int(times[i]), int(times[i + 1])))
                last[topic] = (int(rows.sequence[-1]), int(rows.log_ns[-1]))
        gaps.sort(key=lambda gap: gap.end_ns)
        if self._statistics:
            for channel, count in self._statistics.channel_message_counts.items():
                topic = self._channels[channel].topic if channel in self._channels else f"number {channel}"
                number, before_ns = last.get(topic, (-1, start_ns))
                if count > number + 1:
                    gaps.append(Missing(topic, count - number - 1, before_ns, self._statistics.message_end_time))
        return gaps

    def _lanes(self, topics: Iterable[str] | None, start_ns: int, end_ns: int) -> list[Iterator[Block]]:
        """Blocks of `topics`, those of a lane in the order of publication; at least one lane.

        Small messages and pictures lie in separate chunks that overlap in time: each is a lane.
        """
        wanted = None if topics is None else set(topics)
        ids = {i for i, c in self._channels.items() if wanted is None or c.topic in wanted}
        if not self._ours:  # rewritten by another tool: no promise about chunks
            return [iter([joined(list(self._chosen(self._chunks, ids, start_ns, end_ns)))])]
        pictures = {i for i in ids if self._channels[i].topic.endswith(PICTURES)}
        lanes = []
        if ids - pictures or not pictures:
            lanes.append(self._chosen([c for c in self._chunks if c.compression], ids, start_ns, end_ns))
        if pictures:
            lanes.append(self._chosen([c for c in self._chunks if not c.compression], ids, start_ns, end_ns))
        return lanes

    def _chosen(self, chunks: list[Chunk], ids: set[int], start_ns: int, end_ns: int) -> Iterator[Block]:
        """The messages of the channels `ids` in `chunks`, a chunk at a time; none is empty."""
        known, wanted = np.zeros(1 << 16, dtype=bool), np.zeros(1 << 16, dtype=bool)
        known[[*self._channels]], wanted[[*ids]] = True, True
        with self.path.open("rb") as file:
            for chunk in chunks:
                if chunk.end_ns < start_ns or chunk.start_ns > end_ns:
                    continue
                file.seek(chunk.offset)
                try:
                    block, whole = split(chunk.unpack(file.read(chunk.size)))
                except ValueError as error:
                    self._bad_chunk(chunk, str(error))
                    continue
                if not whole:
                    self._bad_chunk(chunk, "it ends within a message")
                for channel in np.unique(block.channel[~known[block.channel]]).tolist():
                    self._fault(f"messages of a topic that is not described (number {channel}) were left out")
                rows = wanted[block.channel]
                if start_ns > 0 or end_ns < _FOREVER_NS:
                    rows &= (block.log_ns >= start_ns) & (block.log_ns <= end_ns)
                if rows.any():
                    yield block if rows.all() else block.chosen(rows)

    def _raw(self, block: Block) -> Iterator[Raw]:
        data, names = block.data.tobytes(), {i: c.topic for i, c in self._channels.items()}
        log_ns = block.log_ns.view(np.uint64)
        columns = (block.channel, block.sequence, log_ns, block.start, block.end)
        for channel, sequence, t, start, end in zip(*(column.tolist() for column in columns), strict=True):
            yield Raw(t, names[channel], sequence, data[start:end])

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
