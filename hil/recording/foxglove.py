"""A run's messages in Foxglove's schemas, which Rerun, Foxglove and Lichtblick show without a plug-in.

Views are for display only: thinned to 50 Hz, pictures as JPEG; a run is judged by the `/perch/...` topics. Frames:
world (ENU) -> vehicle (FLU) -> camera (optical: x right, y down, z forward); world -> board (x up-slope, z the normal);
world -> board_belief (the filter's estimate).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet

from hil.contract import messages as m
from hil.recording.foxglove_poses import Pose, Transforms
from vehicle.camera.pinhole import Camera

_PERIOD_NS = 20_000_000  # of transforms and poses
_PREVIEW_PERIOD_NS = 66_000_000  # at most 15 Hz; every fourth picture at 60 Hz, every second at 30
_PICTURES_KEPT = 32  # sent pictures whose detection may still come
_LEVELS = {"info": Log.INFO, "warning": Log.WARNING, "error": Log.ERROR}
_BOXES = {  # frame -> thickness (m), colour
    "board": (0.01, (0.85, 0.85, 0.85, 1.0)), "board_belief": (0.005, (0.2, 0.6, 1.0, 0.5)),
    "vehicle": (0.06, (1.0, 0.5, 0.1, 1.0)),
}  # fmt: skip
_DISTORTION = {"pinhole": "plumb_bob", "rational": "rational_polynomial", "fisheye": "kannala_brandt"}
PICTURES = ("none", "preview", "all", "raw")

View = tuple[str, bytes]


def schema_set(message: Any) -> bytes:
    """The FileDescriptorSet of a generated protobuf class: its own file and everything that file imports."""
    files: dict[str, FileDescriptorProto] = {}

    def add(descriptor: Any) -> None:
        for dependency in descriptor.dependencies:
            add(dependency)
        if descriptor.name not in files:
            files[descriptor.name] = FileDescriptorProto()
            descriptor.CopyToProto(files[descriptor.name])

    add(message.DESCRIPTOR.file)
    return FileDescriptorSet(file=files.values()).SerializeToString()


def optical_from_tilt(tilt: float) -> m.Quat:
    """Body-from-optical rotation (w, x, y, z) of a forward-looking camera tilted down by `tilt` rad."""
    c, s = math.cos(tilt / 2), math.sin(tilt / 2)  # Ry(tilt) * (0.5, -0.5, 0.5, -0.5)
    return (0.5 * (c - s), -0.5 * (c + s), 0.5 * (c + s), -0.5 * (c - s))


def belief_orientation(heading: float, inclination: float) -> m.Quat:
    """World from board, w, x, y, z: Rz(heading) Ry(-inclination)."""
    c, s = math.cos(heading / 2), math.sin(heading / 2)
    d, e = math.cos(inclination / 2), -math.sin(inclination / 2)
    return (c * d, -s * e, c * e, s * d)


class FoxgloveView:
    """Turns messages of the run into view messages: `view(topic, message)` returns [(view topic, bytes), ...].

    `pictures`: none; preview (half size, at most 15 Hz); all (every picture, full size, JPEG); raw (preview here, and
    the recorder keeps every picture bit for bit).
    """

    def __init__(self, camera: Camera | None = None, pictures: str = "preview", board_size: float = 0.42) -> None:
        if pictures not in PICTURES:
            raise ValueError(f"pictures is {pictures!r}: choose one of {', '.join(PICTURES)}")
        self.camera, self.pictures, self.board_size = camera or Camera(), pictures, board_size
        self._due: dict[str, int] = {}
        self._drawn: set[str] = set()  # frames whose box was sent
        self._scales: dict[int, int] = {}  # exposure time of the newest pictures sent -> by what they were reduced
        self._views: dict[str, Callable[[Any], list[View]]] = {
            "truth/vehicle": self._vehicle,
            "mocap/vehicle": self._vehicle,
            "truth/board": self._board,
            "mocap/board": self._board,
            "belief": self._belief,
            "board/detection": self._detection,
            "camera/image": self._image,
            "event": self._event,
        }
        self.topics, self._truth = frozenset(self._views), set[str]()
        self._mount = self.camera.offset, optical_from_tilt(self.camera.tilt)
        self._pose = Pose()
        self._frames = {
            "vehicle": Transforms(("world", "vehicle"), ("vehicle", "camera")),
            **{frame: Transforms(("world", frame)) for frame in ("board", "board_belief")},
        }

    CHANNELS = (
        ("/tf", FrameTransforms, "small"),
        ("/vehicle/pose", PoseInFrame, "small"),
        ("/board/pose", PoseInFrame, "small"),
        ("/belief/pose", PoseInFrame, "small"),
        ("/detection/pose", PoseInFrame, "small"),
        ("/log", Log, "small"),
        ("/scene", SceneUpdate, "small"),
        ("/camera/calibration", CameraCalibration, "small"),
        ("/camera/annotations", ImageAnnotations, "small"),
        ("/camera/image", CompressedImage, "pictures"),
    )

    def __call__(self, topic: str, message: Any) -> list[View]:
        view = self._views.get(topic)
        if view is None:
            return []
        source, _, subject = topic.partition("/")
        if source == "truth":
            self._truth.add(subject)
        elif source == "mocap" and subject in self._truth:
            return []  # one pose a body: the truth where there is one
        return view(message)

    def _is_due(self, what: str, stamp_ns: int, period_ns: int = _PERIOD_NS) -> bool:
        if stamp_ns < self._due.get(what, -(2**62)):
            return False
        self._due[what] = stamp_ns + period_ns
        return True

    def _vehicle(self, state: m.VehicleState) -> list[View]:
        if not self._is_due("vehicle", state.stamp_ns):
            return []
        where = state.position, state.orientation
        return [
            ("/tf", self._frames["vehicle"].filled(state.stamp_ns, where, self._mount)),
            ("/vehicle/pose", self._pose.filled(state.stamp_ns, *where)),
            *self._box(state.stamp_ns, "vehicle"),
        ]

    def _board(self, state: m.BoardState) -> list[View]:
        if not self._is_due("board", state.stamp_ns):
            return []
        views = self._body(state.stamp_ns, "board", "/board/pose", state.position, state.orientation)
        return [*views, *self._box(state.stamp_ns, "board")]

    def _body(self, stamp_ns: int, frame: str, topic: str, position: m.Vec3, orientation: m.Quat) -> list[View]:
        moved = self._frames[frame].filled(stamp_ns, (position, orientation))
        return [("/tf", moved), (topic, self._pose.filled(stamp_ns, position, orientation))]

    def _belief(self, belief: m.Belief) -> list[View]:
        if not belief.valid or not self._is_due("belief", belief.stamp_ns):
            return []
        orientation = belief_orientation(belief.heading, belief.inclination)
        views = self._body(belief.stamp_ns, "board_belief", "/belief/pose", belief.position, orientation)
        return [*views, *self._box(belief.stamp_ns, "board_belief")]

    def _detection(self, seen: m.Detection) -> list[View]:
        views = (
            [("/detection/pose", self._pose.filled(seen.stamp_ns, seen.position, seen.orientation))]
            if seen.found
            else []
        )
        scale = self._scales.get(seen.stamp_ns)
        return views if scale is None else [*views, ("/camera/annotations", _outlines(seen, scale))]

    def _event(self, event: m.Event) -> list[View]:
        log = Log(level=_LEVELS.get(event.severity, Log.UNKNOWN), message=event.text, name=event.source)
        log.timestamp.FromNanoseconds(event.stamp_ns)
        return [("/log", log.SerializeToString())]

    def _image(self, image: m.Image) -> list[View]:
        full = self.pictures == "all"
        if self.pictures == "none" or not (full or self._is_due("image", image.stamp_ns, _PREVIEW_PERIOD_NS)):
            return []
        pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width)
        scale = 1
        if not full:
            scale = 2
            pixels = cv2.resize(pixels, (image.width // 2, image.height // 2), interpolation=cv2.INTER_AREA)
        ok, jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 90 if full else 80])
        if not ok:
            raise ValueError(f"picture {image.sequence} could not be compressed")
        view = CompressedImage(frame_id="camera", data=jpeg.tobytes(), format="jpeg")
        view.timestamp.FromNanoseconds(image.stamp_ns)
        views = [("/camera/image", view.SerializeToString())]
        self._scales[image.stamp_ns] = scale
        if len(self._scales) > _PICTURES_KEPT:
            del self._scales[next(iter(self._scales))]
        if self._is_due("calibration", image.stamp_ns, 1_000_000_000):
            views.insert(0, ("/camera/calibration", self._calibration(image.stamp_ns, scale)))
        return views

    def _calibration(self, stamp_ns: int, scale: int) -> bytes:
        camera, lens = self.camera, self.camera.lens
        fx, fy = camera.fx / scale, camera.fy / scale
        # pixel centres are at integers: a picture's left edge is at -0.5 at any scale
        cx, cy = (camera.cx + 0.5) / scale - 0.5, (camera.cy + 0.5) / scale - 0.5
        view = CameraCalibration(
            frame_id="camera",
            width=camera.width // scale,
            height=camera.height // scale,
            distortion_model=_DISTORTION[lens.model] if lens.bends else "plumb_bob",
            D=lens.coefficients if lens.bends else [0.0] * 5,
            K=[fx, 0, cx, 0, fy, cy, 0, 0, 1],
            R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
            P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0],
        )
        view.timestamp.FromNanoseconds(stamp_ns)
        return view.SerializeToString()

    def _box(self, stamp_ns: int, frame: str) -> list[View]:
        """A box that rides on `frame`, sent once, with the frame's first transform: without one it cannot be drawn."""
        if frame in self._drawn:
            return []
        self._drawn.add(frame)
        thickness, colour = _BOXES[frame]
        side = 0.25 if frame == "vehicle" else self.board_size
        scene = SceneUpdate()
        entity = scene.entities.add(id=frame, frame_id=frame, frame_locked=True)
        entity.timestamp.FromNanoseconds(stamp_ns)
        cube = entity.cubes.add()
        cube.pose.orientation.w = 1.0
        cube.size.x, cube.size.y, cube.size.z = side, side, thickness
        cube.color.r, cube.color.g, cube.color.b, cube.color.a = colour
        return [("/scene", scene.SerializeToString())]


def _outlines(seen: m.Detection, scale: int) -> bytes:
    """The tags' corners in the pixels of the sent picture: (0, 0) is the outer corner of its first pixel."""
    view = ImageAnnotations()
    for tag in range(len(seen.corners_px) // 8):
        outline = view.points.add(type=PointsAnnotation.LINE_LOOP, thickness=2.0)
        outline.timestamp.FromNanoseconds(seen.stamp_ns)
        outline.outline_color.g = outline.outline_color.a = 1.0
        for x, y in zip(*(seen.corners_px[8 * tag + axis : 8 * tag + 8 : 2] for axis in (0, 1)), strict=True):
            outline.points.add(x=(x + 0.5) / scale, y=(y + 0.5) / scale)
    return view.SerializeToString()
