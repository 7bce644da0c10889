"""A recording's topics as columns, and what the scorer asks of them.

In a long recording, poses before the last two minutes are thinned to 50 Hz.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hil.contract.topics import TOPICS
from hil.recording.blocks import Block
from hil.recording.reader import Recording
from hil.recording.recorder import PREFIX
from hil.report.recorded.columns import Columns, Messages
from hil.scoring.score import SCORED

_WHOLE_NS = 120_000_000_000  # of the recording's end, kept whole
_SPACING_NS = 20_000_000  # before it; between samples 20 ms apart a path at 10 m/s^2 bends by 0.5 mm
_THINNED = {
    "truth/vehicle", "mocap/vehicle", "truth/board", "mocap/board", "vehicle/odometry", "belief", "car/reference",
    "car/command",
}  # fmt: skip
# What the scorer reads of each topic but the referee's.
_READ = {
    "run/stage": ("stamp_ns", "name", "attempt_start_ns"),
    "truth/board": ("stamp_ns", "speed", "orientation"),
    "mocap/board": ("stamp_ns", "speed", "orientation"),
    "board/detection": ("stamp_ns", "found", "reason"),
    "vehicle/sent": ("stamp_ns", "limited", "tripped"),
}
_REFEREE = "referee/contact"


@dataclass
class _Kept:
    """One topic while it is read."""

    published: list[np.ndarray] = field(default_factory=list)
    log: list[np.ndarray] = field(default_factory=list)
    data: bytearray = field(default_factory=bytearray)
    lengths: list[np.ndarray] = field(default_factory=list)
    slot: int = -1

    def add(self, rows: Block, until_ns: int) -> None:
        """Before `until_ns`, keep the first message of each interval of `_SPACING_NS`."""
        self.published.append(rows.log_ns)
        if rows.log_ns[0] < until_ns:
            slot = rows.log_ns // _SPACING_NS
            first = np.diff(slot, prepend=self.slot) != 0
            self.slot = int(slot[-1])
            rows = rows.chosen(first | (rows.log_ns >= until_ns))
        data, offsets = rows.packed()
        self.log.append(rows.log_ns)
        self.data += data.data
        self.lengths.append(np.diff(offsets))


def read_columns(recording: Recording, topics: Sequence[str]) -> dict[str, Columns]:
    """topic -> columns, of those with a message that can be read; what cannot be decoded is a fault of `recording`."""
    until_ns = (recording.end_ns or 0) - _WHOLE_NS
    kept: dict[str, _Kept] = {}
    for block in recording.blocks([PREFIX + topic for topic in topics]):
        for name, rows in recording.by_topic(block).items():
            topic = name.removeprefix(PREFIX)
            kept.setdefault(topic, _Kept()).add(rows, until_ns if topic in _THINNED else 0)
    found = {}
    for topic in topics:
        one = kept.pop(topic, None)
        if one is None:
            continue
        log_ns, offsets = np.concatenate(one.log), np.cumsum(np.concatenate([[0], *one.lengths]), dtype=np.int64)
        messages, bad = Messages(TOPICS[topic].message, one.data, offsets).checked()
        for index, why in bad.items():
            recording.note(f"{PREFIX}{topic} at {log_ns[index] / 1e9:.3f} s: {why}")
        log_ns = np.delete(log_ns, list(bad))
        if len(log_ns):
            found[topic] = Columns(log_ns, messages, np.concatenate(one.published))
    return found


def scored_messages(recording: Recording) -> Iterator[tuple[int, str, Any]]:
    """(publication, topic, message) of what a `Scorer` takes, in the order of publication.

    The messages have only the fields that it reads; of the referee's, only those that decide.
    """
    for block in recording.blocks([PREFIX + topic for topic in SCORED]):
        lanes = (_lane(name.removeprefix(PREFIX), rows) for name, rows in recording.by_topic(block).items())
        entries = sorted((entry for lane in lanes for entry in lane), key=lambda entry: entry[:2])
        yield from ((t, topic, message) for t, _, topic, message in entries)


def _lane(topic: str, rows: Block) -> Iterator[tuple[int, int, str, Any]]:
    """(publication, place in the block, topic, message) of one topic's messages that can be decoded."""
    messages, bad = Messages(TOPICS[topic].message, *rows.packed()).checked()
    columns = Columns(np.delete(rows.log_ns, list(bad)), messages)
    chosen, place = np.arange(len(columns)), np.delete(rows.start, list(bad))
    if topic == _REFEREE:
        chosen = np.flatnonzero(columns["outcome"] != "ongoing")
    each = columns.rows(*_READ[topic]) if topic in _READ else (messages[i] for i in chosen.tolist())
    times = (columns.log_ns[chosen].tolist(), place[chosen].tolist())
    return ((t, at, topic, message) for t, at, message in zip(*times, each, strict=True))
