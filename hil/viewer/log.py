"""A run as Rerun sees it: the scene, the pictures and the report's own series. Needs the optional Rerun SDK.

World ENU; `world/vehicle/camera` is the pinhole with the pictures. Times are seconds from the attempt's start.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.message import DecodeError, Message
from rerun import blueprint as rrb

from hil.recording.foxglove import belief_orientation, optical_from_tilt
from hil.report.drawing.charts import BOARD, SEEN, VEHICLE, TimePlot, thin
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import Motion
from hil.report.sections import commands, estimate, motion, perception, touchdown
from hil.viewer import scene
from hil.viewer.scene import BELIEF_AT, BOARD_AT, BODY, CAMERA, EVENTS, PLOTS, WORLD, rgb, xyzw
from vehicle.camera.pinhole import Camera

TIMELINE = "attempt"
_BEFORE_NS = 500_000_000

# The report's plots that are worth a row in the viewer, by their keys: three tabs of them.
_TABS = {
    "perching": ("rho", "speed", "pitch", "closing"),
    "estimate": ("tags", "belief-position", "belief-angles", "belief-speed"),
    "commands": ("rate-0", "rate-1", "rate-2", "thrust"),
}


def blueprint(recorded: Recorded) -> rrb.Blueprint:
    """The lay-out made for perching: scene beside picture and log, series under them."""
    titles = {plot.key: f"{plot.title} ({plot.unit})" for plot in _plots(recorded)}
    return scene.layout(
        TIMELINE, {name: [(key, titles[key]) for key in keys if key in titles] for name, keys in _TABS.items()}
    )


def log_run(stream: rr.RecordingStream, recorded: Recorded) -> None:
    """Log everything the recording holds to `stream`; what is missing is left out."""
    scene.draw_world(stream)
    if recorded.vehicle:
        _body(stream, recorded, BODY, recorded.vehicle, VEHICLE)
        scene.draw_arms(stream)
    if recorded.board:
        _body(stream, recorded, BOARD_AT, recorded.board, BOARD)
        scene.draw_board(stream, recorded.board_size, recorded.tolerance.distance)
    _belief(stream, recorded)
    _detections(stream, recorded)
    _camera(stream, recorded)
    for plot in _plots(recorded):
        _series(stream, recorded, plot)
    _events(stream, recorded)


def _shown(recorded: Recorded, t_ns: np.ndarray | int) -> np.ndarray:
    """Mask of the times worth showing: the attempt with half a second before it, or everything if there was none."""
    return np.asarray(t_ns) >= (recorded.window_ns[0] - _BEFORE_NS if recorded.attempt_ns is not None else 0)


def _time(recorded: Recorded, t_ns: np.ndarray) -> list[rr.TimeColumn]:
    origin = recorded.attempt_ns if recorded.attempt_ns is not None else recorded.span_ns[0]
    return [rr.TimeColumn(TIMELINE, duration=(t_ns - origin).astype("timedelta64[ns]"))]


def _body(stream: rr.RecordingStream, recorded: Recorded, path: str, motion: Motion, colour: str) -> None:
    """A moving frame, and its path during the attempt as a line."""
    keep = thin(recorded, motion.t)
    keep = keep[_shown(recorded, motion.t[keep])]
    poses = rr.Transform3D.columns(translation=motion.position[keep], quaternion=xyzw(motion.orientation[keep]))
    stream.send_columns(path, indexes=_time(recorded, motion.t[keep]), columns=poses)
    start, end = recorded.window_ns
    line = motion.position[keep][(motion.t[keep] >= start) & (motion.t[keep] <= end)]
    if len(line) > 1:
        stream.log(f"{path.replace(WORLD, f'{WORLD}/paths')}", rr.LineStrips3D([line], colors=rgb(colour)), static=True)


def _belief(stream: rr.RecordingStream, recorded: Recorded) -> None:
    belief = recorded.topics.get("belief")
    valid = [m for m in belief.messages if m.valid and _shown(recorded, m.stamp_ns)] if belief else []
    if not valid:
        return
    t = np.array([m.stamp_ns for m in valid])
    orientation = np.array([belief_orientation(m.heading, m.inclination) for m in valid])
    poses = rr.Transform3D.columns(translation=np.array([m.position for m in valid]), quaternion=xyzw(orientation))
    stream.send_columns(BELIEF_AT, indexes=_time(recorded, t), columns=poses)
    stream.set_time(TIMELINE, duration=float(recorded.seconds(valid[0].stamp_ns)))
    scene.draw_believed(stream, recorded.board_size)
    stream.reset_time()


def _detections(stream: rr.RecordingStream, recorded: Recorded) -> None:
    detections = recorded.topics.get("board/detection")
    found = [m for m in detections.messages if m.found and _shown(recorded, m.stamp_ns)] if detections else []
    if found:
        t = np.array([m.stamp_ns for m in found])
        points = rr.Points3D.columns(positions=np.array([m.position for m in found]))
        stream.log(f"{WORLD}/detection", rr.Points3D.from_fields(colors=rgb(SEEN), radii=0.02), static=True)
        stream.send_columns(f"{WORLD}/detection", indexes=_time(recorded, t), columns=points)


def _camera(stream: rr.RecordingStream, recorded: Recorded) -> None:
    """Mount and intrinsics as recorded (nominal if not), pictures, and the detected corners in their pixels."""
    camera = Camera()
    mount, q = camera.offset, optical_from_tilt(camera.tilt)
    for transform in _first(
        recorded, "/tf", FrameTransforms, lambda m: [t for t in m.transforms if t.child_frame_id == "camera"]
    ):
        p, r = transform.translation, transform.rotation
        mount, q = (p.x, p.y, p.z), (r.w, r.x, r.y, r.z)
    matrix, width, height = camera.matrix, camera.width, camera.height
    for k in _first(recorded, "/camera/calibration", CameraCalibration, lambda m: [m]):
        matrix, width, height = np.array(k.K).reshape(3, 3), k.width, k.height
    scene.draw_lens(stream, mount, q, matrix, (width, height))
    stamps, blobs = [], []
    for raw in recorded.recording.raw(["/camera/image"]) if "/camera/image" in recorded.recording.topics else ():
        view = _parsed(CompressedImage, raw.data)
        if view is not None and _shown(recorded, view.timestamp.ToNanoseconds()):
            stamps.append(view.timestamp.ToNanoseconds())
            blobs.append(np.frombuffer(view.data, np.uint8))
    if blobs:
        images = rr.EncodedImage.columns(blob=blobs, media_type=["image/jpeg"] * len(blobs))
        stream.send_columns(CAMERA, indexes=_time(recorded, np.array(stamps)), columns=images)
    _corners(stream, recorded, width / camera.width, set(stamps))


def _corners(stream: rr.RecordingStream, recorded: Recorded, scale: float, pictures: set[int]) -> None:
    """Outlines of the tags, only on recorded pictures if there are any: on an older picture they would seem wrong."""
    detections = recorded.topics.get("board/detection")
    if detections is None or not any(m.corners_px for m in detections.messages):
        return
    for m in detections.messages:
        if not _shown(recorded, m.stamp_ns) or (pictures and m.stamp_ns not in pictures):
            continue
        stream.set_time(TIMELINE, duration=float(recorded.seconds(m.stamp_ns)))
        scene.draw_corners(stream, m.tag_ids, m.corners_px, scale)
    stream.reset_time()


def _plots(recorded: Recorded) -> list[TimePlot]:
    wanted = {key for keys in _TABS.values() for key in keys}
    sections = (
        build(recorded) for build in (touchdown.build, motion.build, perception.build, estimate.build, commands.build)
    )
    return [p for section in sections for p in section.parts if isinstance(p, TimePlot) and p.key in wanted]


def _series(stream: rr.RecordingStream, recorded: Recorded, plot: TimePlot) -> None:
    for i, series in enumerate(plot.series):
        keep = thin(recorded, series.t, every=series.style != "dots")
        keep = keep[_shown(recorded, series.t[keep])]
        keep = keep[np.isfinite(series.y[keep])] if series.style == "dots" else keep
        if not len(keep):
            continue
        path, colour = f"{PLOTS}/{plot.key}/{i}", rgb(series.colour)
        name = series.name or plot.series[i - 1].name
        style = rr.SeriesPoints if series.style == "dots" else rr.SeriesLines
        stream.log(path, style(colors=colour, names=name), static=True)
        scalars = rr.Scalars.columns(scalars=series.y[keep])
        stream.send_columns(path, indexes=_time(recorded, series.t[keep]), columns=scalars)


def _events(stream: rr.RecordingStream, recorded: Recorded) -> None:
    from hil.report.sections.events import marks

    for mark in marks(recorded):
        if not _shown(recorded, mark.t_ns):
            continue
        stream.set_time(TIMELINE, duration=float(recorded.seconds(mark.t_ns)))
        stream.log(EVENTS, rr.TextLog(mark.text, level=scene.LEVELS.get(mark.severity, "INFO")))
    stream.reset_time()


def _first(recorded: Recorded, topic: str, kind: type[Message], pick: Callable[[Any], list[Any]]) -> list[Any]:
    """What `pick` finds in the first message of a view topic in which it finds anything."""
    if topic in recorded.recording.topics:
        for raw in recorded.recording.raw([topic]):
            message = _parsed(kind, raw.data)
            if message is not None and (found := pick(message)):
                return found[:1]
    return []


def _parsed(kind: type[Message], data: bytes) -> Any:
    try:
        return kind.FromString(data)
    except DecodeError:
        return None
