"""Shows a finished run in Rerun: its messages through `ViewStream`, then the plots that need the whole recording.

Times are seconds from the attempt's start. Needs the optional Rerun SDK.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.message import DecodeError, Message

from hil.report.drawing.charts import BOARD, VEHICLE, TimePlot, thin
from hil.report.recorded.columns import Columns
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import Motion
from hil.report.sections import commands, estimate, touchdown
from hil.viewer import scene
from hil.viewer.scene import ATTEMPT, PLOTS, WORLD, rgb
from hil.viewer.stream import TABS, ViewStream
from vehicle.camera.pinhole import Camera

_BEFORE_NS = 500_000_000
_PICTURES = "/camera/image"
_POSES = ("truth/vehicle", "mocap/vehicle", "vehicle/odometry", "truth/board", "mocap/board")
_CHANGING = {"run/stage": "name", "referee/contact": "outcome"}  # shown when this field changes
_STREAMED = (*_CHANGING, "event", "belief", "board/detection", "policy/action", "vehicle/sent")

# The report's plots that need more than one message at a time: tab -> keys.
_DERIVED = {"perching": ("closing",), "estimate": ("belief-position", "belief-angles", "belief-speed")}
_THRUST, _THRUST_NAME = "thrust", "achieved, from velocity"  # the one derived line of a streamed plot


class _Shown(NamedTuple):
    """One thing to show, in the order of publication. `topic` empty: a recorded JPEG picture."""

    log_ns: int
    stamp_ns: int
    topic: str
    message: Any


def blueprint(recorded: Recorded) -> rrb.Blueprint:
    """The layout of a run under way, with the derived plots."""
    derived = {plot.key: f"{plot.title} ({plot.unit})" for plot in _plots(recorded)}
    tabs = {name: [(plot.key, plot.title) for plot in plots] for name, plots in TABS.items()}
    for name, keys in _DERIVED.items():
        tabs.setdefault(name, []).extend((key, derived[key]) for key in keys if key in derived)
    return scene.layout(ATTEMPT, tabs)


def log_run(stream: rr.RecordingStream, recorded: Recorded) -> None:
    """Log everything the recording holds to `stream`; what is missing is left out."""
    view = ViewStream(
        stream, recorded.board_size, recorded.tolerance.distance, _camera(recorded),
        timeline=ATTEMPT, origin_ns=_origin_ns(recorded),
    )  # fmt: skip
    size = _picture_size(recorded)
    for shown in heapq.merge(_messages(recorded), _pictures(recorded), key=lambda shown: shown.log_ns):
        if shown.topic:
            view.add(shown.topic, shown.message)
        else:
            view.add_picture(shown.stamp_ns, shown.message, *size)
    stream.reset_time()
    _paths(stream, recorded)
    for plot in _plots(recorded):
        _series(stream, recorded, plot)


def _origin_ns(recorded: Recorded) -> int:
    return recorded.attempt_ns if recorded.attempt_ns is not None else recorded.span_ns[0]


def _shown(recorded: Recorded, t_ns: np.ndarray | int) -> np.ndarray:
    """Mask of the times worth showing."""
    return np.asarray(t_ns) >= _first_ns(recorded)


def _first_ns(recorded: Recorded) -> int:
    """From when on the run is shown: half a second before the attempt, or from its start if there was none."""
    return max(0, recorded.window_ns[0] - _BEFORE_NS) if recorded.attempt_ns is not None else 0


def _messages(recorded: Recorded) -> Iterator[_Shown]:
    """The messages to show, thinned as the report's plots are; of the poses only the best source of each body."""
    lanes = []
    for topic in (*_STREAMED, *(t for t in _POSES if t in (recorded.vehicle_source, recorded.board_source))):
        columns = recorded.topics.get(topic)
        if columns is None:
            continue
        stamps = columns.nanoseconds()
        keep = (
            _changes(columns, _CHANGING[topic])
            if topic in _CHANGING
            else thin(recorded, stamps, every=topic != "event")
        )
        keep = keep[_shown(recorded, stamps[keep])]
        lanes.append(_lane(topic, columns, keep, stamps[keep]))
    yield from heapq.merge(*lanes, key=lambda shown: shown.log_ns)


def _changes(columns: Columns, field: str) -> np.ndarray:
    """Indices of the first message and of those whose `field` differs from the one before."""
    values = columns[field]
    return np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))


def _lane(topic: str, columns: Columns, keep: np.ndarray, stamps: np.ndarray) -> Iterator[_Shown]:
    """The messages `keep` of one topic, decoded one at a time."""
    for i, log_ns, stamp_ns in zip(keep.tolist(), columns.log_ns[keep].tolist(), stamps.tolist(), strict=True):
        yield _Shown(log_ns, stamp_ns, topic, columns.messages[i])


def _pictures(recorded: Recorded) -> Iterator[_Shown]:
    recording = recorded.recording
    for raw in recording.raw([_PICTURES], start_ns=_first_ns(recorded)) if _PICTURES in recording.topics else ():
        picture = _parsed(CompressedImage, raw.data)
        if picture is not None and _shown(recorded, picture.timestamp.ToNanoseconds()):
            yield _Shown(raw.log_ns, picture.timestamp.ToNanoseconds(), "", picture.data)


def _camera(recorded: Recorded) -> Camera:
    """Mount and intrinsics as recorded, nominal if not; the intrinsics are of the picture before it was reduced."""
    camera = Camera()
    for transforms in _parsed_all(recorded, "/tf", FrameTransforms):
        mounted = [t for t in transforms.transforms if t.child_frame_id == "camera"]
        if mounted:
            p, q = mounted[0].translation, mounted[0].rotation
            tilt = 2 * math.atan2(-q.x - q.w, q.w - q.x)  # the inverse of `optical_from_tilt`
            camera = replace(camera, offset=(p.x, p.y, p.z), tilt=tilt)
            break
    for k in _parsed_all(recorded, "/camera/calibration", CameraCalibration):
        scale = k.width / camera.width
        if scale > 0 and len(k.K) == 9:
            fx, cx, fy, cy = (k.K[i] / scale for i in (0, 2, 4, 5))
            camera = replace(camera, fx=fx, fy=fy, cx=cx, cy=cy)
        break
    return camera


def _picture_size(recorded: Recorded) -> tuple[int, int]:
    """Width and height (px) of the recorded pictures."""
    for k in _parsed_all(recorded, "/camera/calibration", CameraCalibration):
        return k.width, k.height
    return Camera().width, Camera().height


def _paths(stream: rr.RecordingStream, recorded: Recorded) -> None:
    """Both bodies' paths during the attempt, as lines."""
    start, end = recorded.window_ns
    bodies: tuple[tuple[str, Motion | None, str], ...] = (
        ("vehicle", recorded.vehicle, VEHICLE), ("board", recorded.board, BOARD),
    )  # fmt: skip
    for name, motion, colour in bodies:
        if motion is None:
            continue
        keep = thin(recorded, motion.t)
        line = motion.position[keep][(motion.t[keep] >= start) & (motion.t[keep] <= end)]
        if len(line) > 1:
            stream.log(f"{WORLD}/paths/{name}", rr.LineStrips3D([line], colors=rgb(colour)), static=True)


def _plots(recorded: Recorded) -> list[TimePlot]:
    wanted = {_THRUST, *(key for keys in _DERIVED.values() for key in keys)}
    sections = (build(recorded) for build in (touchdown.build, estimate.build, commands.build))
    return [p for section in sections for p in section.parts if isinstance(p, TimePlot) and p.key in wanted]


def _series(stream: rr.RecordingStream, recorded: Recorded, plot: TimePlot) -> None:
    for i, series in enumerate(plot.series):
        if plot.key == _THRUST and series.name != _THRUST_NAME:
            continue
        keep = thin(recorded, series.t, series.y, every=series.style != "dots")
        keep = keep[_shown(recorded, series.t[keep])]
        keep = keep[np.isfinite(series.y[keep])] if series.style == "dots" else keep
        if not len(keep):
            continue
        line = 2 if plot.key == _THRUST else i
        path, colour = f"{PLOTS}/{plot.key}/{line}", rgb(series.colour)
        name = series.name or plot.series[i - 1].name
        style = rr.SeriesPoints if series.style == "dots" else rr.SeriesLines
        stream.log(path, style(colors=colour, names=name), static=True)
        indexes = [rr.TimeColumn(ATTEMPT, duration=(series.t[keep] - _origin_ns(recorded)).astype("timedelta64[ns]"))]
        stream.send_columns(path, indexes=indexes, columns=rr.Scalars.columns(scalars=series.y[keep]))


def _parsed_all(recorded: Recorded, topic: str, kind: type[Message]) -> Iterator[Any]:
    """The readable messages of a view topic."""
    for raw in recorded.recording.raw([topic]) if topic in recorded.recording.topics else ():
        message = _parsed(kind, raw.data)
        if message is not None:
            yield message


def _parsed(kind: type[Message], data: bytes) -> Any:
    try:
        return kind.FromString(data)
    except DecodeError:
        return None
