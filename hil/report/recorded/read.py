"""A recording's topics as columns. In a long recording, poses before the last two minutes are thinned to 50 Hz."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.contract.topics import TOPICS
from hil.recording.reader import Recording
from hil.recording.recorder import PREFIX
from hil.report.recorded.columns import Columns, Messages

_WHOLE_NS = 120_000_000_000  # of the recording's end, kept whole
_SPACING_NS = 20_000_000  # before it; between samples 20 ms apart a path at 10 m/s^2 bends by 0.5 mm
_THINNED = {"truth/vehicle", "mocap/vehicle", "vehicle/odometry", "belief", "car/reference", "car/command"}


def read_columns(recording: Recording, topics: Sequence[str]) -> dict[str, Columns]:
    """topic -> columns, of those with a message that can be read; what cannot be decoded is a fault of `recording`."""
    until_ns = (recording.end_ns or 0) - _WHOLE_NS
    spacing_ns = {PREFIX + topic: _SPACING_NS for topic in _THINNED}
    found = {}
    packed = recording.packed([PREFIX + topic for topic in topics], spacing_ns=spacing_ns, until_ns=until_ns)
    for name in list(packed):
        one, topic = packed.pop(name), name.removeprefix(PREFIX)
        published_ns, log_ns, offsets = (np.array(part, dtype=np.int64) for part in (one.published_ns, *one[1::2]))
        messages = Messages(TOPICS[topic].message, one.data, offsets)
        bad = messages.faults()
        for index, why in bad.items():
            recording.note(f"{name} at {log_ns[index] / 1e9:.3f} s: {why}")
        if bad:
            good = np.setdiff1d(np.arange(len(log_ns)), list(bad))
            log_ns, messages = log_ns[good], _chosen(messages, good)
        if len(log_ns):
            found[topic] = Columns(log_ns, messages, published_ns)
    return {topic: found[topic] for topic in topics if topic in found}


def _chosen(messages: Messages, chosen: np.ndarray) -> Messages:
    edges = messages.offsets.tolist()
    parts = [messages.data[edges[i] : edges[i + 1]] for i in chosen.tolist()]
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts], dtype=np.int64)]).astype(np.int64)
    return Messages(messages.kind, b"".join(parts), offsets)
