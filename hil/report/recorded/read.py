"""A recording's topics as columns, and what the scorer asks of them.

In a long recording, poses before the last 90 s are thinned to 25 Hz.
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

_WHOLE_NS = 90_000_000_000  # of the recording's end, kept whole
_SPACING_NS = 40_000_000  # before it; between samples 40 ms apart a path at 10 m/s^2 bends by 2 mm
_THINNED = {
    "truth/vehicle", "mocap/vehicle", "truth/board", "mocap/board", "vehicle/odometry", "belief", "car/reference",
    "car/command", "car/sent", "car/feedback",
}  # fmt: skip
# What the scorer reads of a topic; of the others it gets whole messages.
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
    """One topic while it is read; int64 as bytes, for many small arrays take several times as much memory."""

    published: bytearray = field(default_factory=bytearray)
    log: bytearray = field(default_factory=bytearray)
    data: bytearray = field(default_factory=bytearray)
    ends: bytearray = field(default_factory=bytearray)
    slot: int = -1

    def add(self, rows: Block, until_ns: int) -> None:
        """Before `until_ns`, keep the first message of each interval of `_SPACING_NS`."""
        self.published += rows.log_ns.data
        if rows.log_ns[0] < until_ns:
            slot = rows.log_ns // _SPACING_NS
            first = np.diff(slot, prepend=self.slot) != 0
            self.slot = int(slot[-1])
            rows = rows.chosen(first | (rows.log_ns >= until_ns))
        data, offsets = rows.packed()
        self.log += rows.log_ns.data
        self.ends += (offsets[1:] + len(self.data)).data
        self.data += data.data


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
        log_ns = published_ns = np.frombuffer(one.log, np.int64).copy()
        if len(one.published) > len(one.log):
            published_ns = np.frombuffer(one.published, np.int64).copy()
        offsets, data = np.append(0, np.frombuffer(one.ends, np.int64)), bytes(one.data)
        del one  # copies are an eighth smaller than what they grew in
        messages, bad = Messages(TOPICS[topic].message, data, offsets).checked()
        for index, why in bad.items():
            recording.note(f"{PREFIX}{topic} at {log_ns[index] / 1e9:.3f} s: {why}")
        log_ns = np.delete(log_ns, list(bad))
        if len(log_ns):
            found[topic] = Columns(log_ns, messages, published_ns)
    return found


def scored_messages(recording: Recording) -> Iterator[tuple[int, str, Any]]:
    """(publication, topic, message) of what a `Scorer` takes, in the order of publication.

    The messages have only the fields that it reads (`_READ`); of the referee's there are only those that decide. Of the
    board's and the stage's, those are left out that change no score: see `_spare`.
    """
    stage: tuple[str, int] | None = None  # name and start of the attempt, as last published
    for block in recording.blocks([PREFIX + topic for topic in SCORED]):
        lanes = {}
        for name, rows in recording.by_topic(block).items():
            topic = name.removeprefix(PREFIX)
            messages, bad = Messages(TOPICS[topic].message, *rows.packed()).checked()
            good = np.delete(np.arange(len(rows.log_ns)), list(bad))
            if len(good):
                lanes[topic] = (rows.chosen(good), Columns(rows.log_ns[good], messages))
        stages, decided = _stages(lanes), _decided(lanes)
        spare = not len(decided) and "event" not in lanes and stages <= {stage} and stage is not None
        parts = []
        for topic, (rows, columns) in lanes.items():
            chosen = np.arange(len(columns))
            if topic == _REFEREE:
                chosen = decided
            elif spare:
                chosen = _spare(topic, columns, stage[1] if stage else 0)
            parts.append((topic, rows.log_ns[chosen], rows.start[chosen], columns, chosen))
        stage = next(iter(stages)) if len(stages) == 1 else stage if not stages else None
        yield from _merged(parts)


def _stages(lanes: dict[str, Any]) -> set[tuple[str, int]]:
    """The different (name, start of the attempt) in a block."""
    if "run/stage" not in lanes:
        return set()
    columns = lanes["run/stage"][1]
    return set(zip(columns["name"].tolist(), columns.nanoseconds("attempt_start_ns").tolist(), strict=True))


def _decided(lanes: dict[str, Any]) -> np.ndarray:
    """Indices of the referee's messages that decide."""
    return np.flatnonzero(lanes[_REFEREE][1]["outcome"] != "ongoing") if _REFEREE in lanes else np.empty(0, np.int64)


def _spare(topic: str, columns: Columns, start_ns: int) -> np.ndarray:
    """Indices of the messages that a scorer needs of a block without an event, a change of the stage or a verdict.

    Of the board the least and the greatest speed and the last message, of the stage the last.
    """
    n = len(columns)
    if topic == "run/stage":
        return np.array([n - 1])
    if topic in ("truth/board", "mocap/board") and (columns.nanoseconds() >= start_ns).all():
        speed = np.abs(columns["speed"])
        if np.isfinite(speed).all():
            return np.unique([int(speed.argmin()), int(speed.argmax()), n - 1])
    return np.arange(n)


def _merged(parts: list[tuple[str, np.ndarray, np.ndarray, Columns, np.ndarray]]) -> Iterator[tuple[int, str, Any]]:
    """The chosen messages of all topics of a block: by publication, then by place in the file."""
    times = np.concatenate([part[1] for part in parts])
    order = np.lexsort((np.concatenate([part[2] for part in parts]), times))
    topics, messages = [], []
    for topic, log_ns, _, columns, chosen in parts:
        topics += [topic] * len(log_ns)
        if topic not in _READ:
            messages += [columns.messages[i] for i in chosen.tolist()]
        else:
            messages += columns.rows(*_READ[topic], chosen=chosen)
    stamps = times.tolist()
    return ((stamps[i], topics[i], messages[i]) for i in order.tolist())
