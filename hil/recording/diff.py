"""Compares two runs: their recordings message by message, byte for byte, then score and manifest.

Only the manifest's `wall_clock` table may differ between two runs of one seed on one machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from hil.contract.codec import CodecError, codec
from hil.contract.topics import TOPICS
from hil.recording.blocks import Block
from hil.recording.reader import Raw, Recording
from hil.recording.recorder import PICTURES, PREFIX
from hil.recording.runs import open_run


@dataclass(frozen=True, slots=True)
class Difference:
    """The first difference in one topic."""

    topic: str
    index: int  # of the message in the topic
    time_ns: int  # of the earlier of the two
    text: str


@dataclass(frozen=True, slots=True)
class RunDiff:
    """What differs between run a and run b. `messages` counts those that agree, over all topics."""

    messages: int
    topics: tuple[Difference, ...]
    score: tuple[str, ...]
    manifest: tuple[str, ...]
    faults: tuple[str, ...]  # what could not be compared because a recording is incomplete

    @property
    def same_messages(self) -> bool:
        return not self.topics and not self.faults

    @property
    def identical(self) -> bool:
        """Nothing differs but the wall clock."""
        return self.same_messages and not self.score and not self.manifest

    def lines(self) -> list[str]:
        """What to print, the earliest difference first."""
        if self.identical:
            return [f"identical: {self.messages} messages, score and manifest (but for the wall clock)"]
        ordered = sorted(self.topics, key=lambda d: d.time_ns)
        found = [f"{d.topic} message {d.index} at {d.time_ns / 1e9:.4f} s: {d.text}" for d in ordered]
        found += [f"score: {text}" for text in self.score] + [f"manifest: {text}" for text in self.manifest]
        found += [f"not compared: {text}" for text in self.faults]
        head = f"{self.messages} messages agree" if self.topics else f"all {self.messages} messages agree"
        return [head, *found]


def diff_runs(a: Path | str, b: Path | str) -> RunDiff:
    """Compare two run folders. Raises RunError or ReadError if one is no run or cannot be read."""
    run_a, run_b = open_run(a), open_run(b)
    same, topics, faults = diff_recordings(run_a.recording, run_b.recording)
    manifest_a, manifest_b = ({k: v for k, v in r.manifest.items() if k != "wall_clock"} for r in (run_a, run_b))
    return RunDiff(
        messages=same,
        topics=topics,
        score=tuple(_tables(run_a.score, run_b.score)),
        manifest=tuple(_tables(manifest_a, manifest_b)),
        faults=faults,
    )


def diff_recordings(a: Path, b: Path) -> tuple[int, tuple[Difference, ...], tuple[str, ...]]:
    """(messages that agree, first difference of each topic, what is missing) of two recordings."""
    one, two = Recording(a), Recording(b)
    found = [
        Difference(topic, 0, 0, f"only the {'first' if topic in one.topics else 'second'} run recorded this topic")
        for topic in one.topics.keys() ^ two.topics.keys()
    ]
    shared = one.topics.keys() & two.topics.keys()
    pictures = {topic for topic in shared if topic.endswith(PICTURES)}
    same = 0
    for topics in (shared - pictures, pictures):  # each is in the order of publication
        lane = _Lane(one, two, topics)
        lane.compare()
        same += sum(lane.same.values())
        found += lane.found
    faults = [f"{name}: {fault}" for name, r in (("first", one), ("second", two)) for fault in r.faults]
    return same, tuple(sorted(found, key=lambda difference: difference.topic)), tuple(faults)


class _Lane:
    """Compares `topics` of two recordings in one pass; only what the other has not reached yet is kept."""

    def __init__(self, one: Recording, two: Recording, topics: set[str]) -> None:
        self.same = dict.fromkeys(topics, 0)
        self.found: list[Difference] = []
        self._open = set(topics)  # topics without a difference so far
        self._recordings = (one, two)
        self._waiting: tuple[dict[str, list[Block]], ...] = ({}, {})

    def compare(self) -> None:
        """Read both to their ends, always on where less has been read."""
        if not self._open:
            return
        blocks = [recording.blocks(self._open.copy()) for recording in self._recordings]
        reached_ns, ended = [-1, -1], [False, False]
        while not all(ended):
            side = int(ended[0] or (not ended[1] and reached_ns[1] < reached_ns[0]))
            block = next(blocks[side], None)
            if block is None:
                ended[side] = True
                continue
            reached_ns[side] = int(block.log_ns.max(initial=-1))
            for topic, rows in self._recordings[side].by_topic(block).items():
                if topic in self._open:
                    waiting = self._waiting[side].setdefault(topic, [])
                    waiting.append(rows.compact())
                    self._advance(topic)
                    if ended[1 - side] and waiting:  # from here on messages are only counted
                        waiting[-1] = waiting[-1]._replace(data=np.empty(0, dtype=np.uint8))
        for topic in sorted(self._open):
            left = [sum(len(rows.log_ns) for rows in waiting.get(topic, ())) for waiting in self._waiting]
            if any(left):
                side = int(left[1] > 0)
                text = f"the {('first', 'second')[side]} run has {left[side]} messages more"
                first_ns = int(self._waiting[side][topic][0].log_ns[0])
                self.found.append(Difference(topic, self.same[topic], first_ns, text))

    def _advance(self, topic: str) -> None:
        """Compare what both sides have of `topic`."""
        one, two = (waiting.get(topic, []) for waiting in self._waiting)
        while one and two:
            n = min(len(one[0].log_ns), len(two[0].log_ns))
            at = _first_difference(one[0], two[0], n)
            self.same[topic] += n if at is None else at
            if at is not None:
                x, y = (_raw(topic, waiting[0], at) for waiting in (one, two))
                text = _explain(topic, x, y)
                self.found.append(Difference(topic, self.same[topic], min(x.log_ns, y.log_ns), text))
                self._open.remove(topic)
                one.clear()
                two.clear()
                return
            for waiting in (one, two):
                rest = waiting.pop(0)
                if len(rest.log_ns) > n:
                    waiting.insert(0, rest.chosen(np.arange(n, len(rest.log_ns))))


def _first_difference(one: Block, two: Block, n: int) -> int | None:
    """Index of the first of `n` messages whose time or bytes differ, None if there is none."""
    a, b = one.chosen(np.arange(n)), two.chosen(np.arange(n))
    other = np.flatnonzero((a.log_ns != b.log_ns) | (a.end - a.start != b.end - b.start))
    equal = int(other[0]) if len(other) else n
    (x, offsets), (y, _) = (rows.chosen(np.arange(equal)).packed() for rows in (a, b))
    if not np.array_equal(x, y):
        return int(np.searchsorted(offsets, np.flatnonzero(x != y)[0], side="right")) - 1
    return equal if len(other) else None


def _raw(topic: str, rows: Block, i: int) -> Raw:
    return Raw(int(rows.log_ns[i]), topic, 0, rows.data[rows.start[i] : rows.end[i]].tobytes())


def _explain(topic: str, x: Raw, y: Raw) -> str:
    if x.log_ns != y.log_ns:
        return f"published at {x.log_ns} and {y.log_ns} ns ({(y.log_ns - x.log_ns) / 1e6:+.3f} ms)"
    row = TOPICS.get(topic.removeprefix(PREFIX)) if topic.startswith(PREFIX) else None
    if row is not None:
        try:
            one, two = codec(row.message).decode(x.data), codec(row.message).decode(y.data)
        except CodecError as error:
            return str(error)
        for name in (field.name for field in fields(row.message)):
            p, q = getattr(one, name), getattr(two, name)
            if repr(p) != repr(q):
                return f"{name} is {_short(p)} and {_short(q)}{_size(p, q)}"
    at = next(
        (i for i, (p, q) in enumerate(zip(x.data, y.data, strict=False)) if p != q), min(len(x.data), len(y.data))
    )
    return f"{len(x.data)} and {len(y.data)} bytes, which differ from byte {at} on"


def _size(p: Any, q: Any) -> str:
    """How large a difference of numbers is."""
    pairs = zip(p, q, strict=True) if isinstance(p, tuple) and len(p) == len(q) else [(p, q)]
    deltas = [abs(u - v) for u, v in pairs if isinstance(u, int | float) and isinstance(v, int | float)]
    return f" (largest difference {max(deltas):.3g})" if deltas else ""


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _tables(a: Any, b: Any, at: str = "") -> Iterator[str]:
    if isinstance(a, dict) and isinstance(b, dict):
        for key in sorted(a.keys() | b.keys()):
            yield from _tables(a.get(key), b.get(key), f"{at}.{key}" if at else key)
    elif a != b:
        yield f"{at or 'it'} is {_short(a)} and {_short(b)}"
