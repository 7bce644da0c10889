"""Compares two runs: their recordings message by message, byte for byte, then score and manifest.

Only the manifest's `wall_clock` table may differ between two runs of one seed on one machine.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from hil.contract.codec import CodecError, codec
from hil.contract.topics import TOPICS
from hil.recording.reader import Raw, Recording
from hil.recording.recorder import PREFIX
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
    same, found = 0, []
    for topic in sorted(one.topics.keys() | two.topics.keys()):
        if topic not in one.topics or topic not in two.topics:
            where = "second" if topic not in one.topics else "first"
            found.append(Difference(topic, 0, 0, f"only the {where} run recorded this topic"))
            continue
        pairs = itertools.zip_longest(one.raw([topic]), two.raw([topic]))
        for index, (x, y) in enumerate(pairs):
            if x is None or y is None:
                extra = x or y
                more = 1 + sum(1 for _ in pairs)
                which = "second" if x is None else "first"
                time_ns = extra.log_ns if extra else 0
                found.append(Difference(topic, index, time_ns, f"the {which} run has {more} messages more"))
                break
            if x.log_ns != y.log_ns or x.data != y.data:
                found.append(Difference(topic, index, min(x.log_ns, y.log_ns), _explain(topic, x, y)))
                break
            same += 1
    faults = [f"{name}: {fault}" for name, r in (("first", one), ("second", two)) for fault in r.faults]
    return same, tuple(found), tuple(faults)


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
