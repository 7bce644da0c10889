"""Writes a run as a ROS 2 bag: a folder with metadata.yaml and one MCAP file, whole or not at all."""

from __future__ import annotations

import shutil
import struct
import tempfile
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import cv2
from google.protobuf.message import DecodeError
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from hil.contract.codec import CodecError, codec
from hil.contract.messages import Detection, Image
from hil.contract.topics import TOPICS
from hil.recording.reader import Recording
from hil.recording.recorder import PICTURES, PREFIX
from hil.recording.runs import Run, RunError
from hil.ros2.convert import Converter
from hil.ros2.types import typestore
from hil.ros2.views import TF_STATIC, ViewConverter

_VERSION = 8  # of the bag's metadata: Humble reads no later one
_LATEST_NS = 2**63 - 1
_UNFIT = (CodecError, DecodeError, ValueError, OverflowError, struct.error, cv2.error)
_FOREVER = QosTime(2147483647, 4294967295)
_LATCHED = Qos(
    QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, _FOREVER, _FOREVER,
    QosLiveliness.AUTOMATIC, _FOREVER, False,
)  # fmt: skip


class _Encoded(NamedTuple):
    """A ROS message in its binary form (CDR)."""

    topic: str
    kind: str
    data: memoryview


def export(run: Path, out: Path) -> Counter[str]:
    """Write the run (a folder or an .mcap) as a bag in the new folder `out`; returns its messages by topic.

    Times are of the wall clock, if the run's folder tells when it began; else they are of the run's clock. What of the
    recording cannot be read is left out. Raises ReadError (no recording), ValueError (`out` exists), OSError (cannot
    be written).
    """
    recording = Recording(run)
    if out.exists():
        raise ValueError(f"{out} exists already: name a folder that does not")
    counts: Counter[str] = Counter()
    out.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    try:
        zero_ns = zero_of(recording.path.parent)
        bag = Writer(scratch / out.name, version=_VERSION, storage_plugin=StoragePlugin.MCAP)
        bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with bag:
            connections = {}
            for log_ns, one in _messages(recording, zero_ns):
                if one.topic not in connections:
                    connections[one.topic] = bag.add_connection(
                        one.topic, one.kind, typestore=typestore(),
                        offered_qos_profiles=[_LATCHED] if one.topic == TF_STATIC else (),
                    )  # fmt: skip
                bag.write(connections[one.topic], min(max(0, zero_ns + log_ns), _LATEST_NS), one.data)
                counts[one.topic] += 1
        (scratch / out.name).rename(out)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return counts


def zero_of(folder: Path) -> int:
    """ns since 1970 at 0 ns of the run's clock; 0 where the folder does not say."""
    try:
        zero = Run(folder).manifest["wall_clock"]["zero_utc"]
        return round(datetime.fromisoformat(zero).timestamp() * 1000) * 1_000_000  # it is kept in ms
    except (RunError, KeyError, TypeError, ValueError):
        return 0


def _messages(recording: Recording, zero_ns: int) -> Iterator[tuple[int, _Encoded]]:
    """(publication on the run's clock, message), in the order of publication."""
    width, store = next((image.width for image in _raw_pictures(recording)), 0), typestore()
    convert, view = Converter(zero_ns, width > 0), ViewConverter(zero_ns, width)
    kinds = {PREFIX + topic: codec(TOPICS[topic].message) for topic in convert.topics}
    for raw in recording.raw([topic for topic in (*kinds, *view.topics) if topic in recording.topics]):
        try:
            if raw.topic in kinds:
                message = kinds[raw.topic].decode(raw.data)
                if isinstance(message, Detection):
                    view.seen(message.stamp_ns, message.tag_ids)
                found = convert(raw.topic.removeprefix(PREFIX), message)
            else:
                found = view(raw.topic, raw.data)
            encoded = [_Encoded(one.topic, one.kind, store.serialize_cdr(one.content, one.kind)) for one in found]
        except _UNFIT as error:  # a number that its ROS field cannot hold, a picture of -1 lines
            recording.note(f"{raw.topic} at {raw.log_ns / 1e9:.3f} s: {error}")
            continue
        for one in encoded:
            yield raw.log_ns, one


def _raw_pictures(recording: Recording) -> Iterator[Image]:
    if PREFIX + PICTURES in recording.topics:
        for entry in recording.messages([PICTURES]):
            yield entry.message
