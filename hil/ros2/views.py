"""A recording's views as ROS 2 messages: transforms, pictures and their calibration, the tags in their pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations

from hil.ros2.convert import CAMERA
from hil.ros2.tags import detection_array
from hil.ros2.types import Ros, header, make, quaternion, ros, vector

TF_STATIC = "/tf_static"
_DISTORTION = {"kannala_brandt": "equidistant"}  # Foxglove's name -> ROS's; the others are the same


class ViewConverter:
    """Turns view messages into ROS messages. `width`: of the pictures as recorded whole (px), 0 if they are not."""

    def __init__(self, zero_ns: int, width: int) -> None:
        self._zero_ns, self._width = zero_ns, width
        self._mounted = False
        self._tags: dict[int, tuple[int, ...]] = {}
        self._of = {"/tf": self._transforms, "/camera/calibration": self._calibration}
        if not width:
            self._of |= {"/camera/image": self._picture, "/camera/annotations": self._outlines}

    @property
    def topics(self) -> tuple[str, ...]:
        """View topics that are converted."""
        return tuple(self._of)

    def seen(self, stamp_ns: int, tags: tuple[int, ...]) -> None:
        """Receive which tags were found in the picture of `stamp_ns`; its outlines come next."""
        self._tags = {stamp_ns: tags}

    def __call__(self, topic: str, data: bytes) -> list[Ros]:
        """The ROS messages of one view message. Raises DecodeError if `data` is none."""
        convert = self._of.get(topic)
        return [] if convert is None else convert(data)

    def _transforms(self, data: bytes) -> list[Ros]:
        view = FrameTransforms.FromString(data)
        moving = [t for t in view.transforms if t.child_frame_id != CAMERA]
        still = [t for t in view.transforms if t.child_frame_id == CAMERA]
        out = [ros("/tf", "tf2_msgs/TFMessage", transforms=[self._transform(t) for t in moving])] if moving else []
        if still and not self._mounted:  # the mount does not change: it is told once
            self._mounted = True
            out.append(ros(TF_STATIC, "tf2_msgs/TFMessage", transforms=[self._transform(t) for t in still]))
        return out

    def _transform(self, t: Any) -> Any:
        place, turn = t.translation, t.rotation
        moved = make(
            "geometry_msgs/Transform", translation=vector((place.x, place.y, place.z)),
            rotation=quaternion((turn.w, turn.x, turn.y, turn.z)),
        )  # fmt: skip
        head = header(self._zero_ns + t.timestamp.ToNanoseconds(), t.parent_frame_id)
        return make("geometry_msgs/TransformStamped", header=head, child_frame_id=t.child_frame_id, transform=moved)

    def _calibration(self, data: bytes) -> list[Ros]:
        view = CameraCalibration.FromString(data)
        if len(view.K) != 9 or not view.width:
            return []
        scale = self._width / view.width if self._width else 1.0
        fx, cx, fy, cy = view.K[0] * scale, _scaled(view.K[2], scale), view.K[4] * scale, _scaled(view.K[5], scale)
        k = np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1], float)
        p = np.column_stack((k.reshape(3, 3), np.zeros(3))).reshape(12)
        region = make("sensor_msgs/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        return [
            ros(
                "/camera/camera_info", "sensor_msgs/CameraInfo",
                header=header(self._zero_ns + view.timestamp.ToNanoseconds(), CAMERA),
                height=round(view.height * scale), width=round(view.width * scale),
                distortion_model=_DISTORTION.get(view.distortion_model, view.distortion_model),
                d=np.array(view.D, float), k=k, r=np.eye(3).reshape(9), p=p, binning_x=0, binning_y=0, roi=region,
            )
        ]  # fmt: skip

    def _picture(self, data: bytes) -> list[Ros]:
        view = CompressedImage.FromString(data)
        return [
            ros(
                "/camera/image_raw/compressed", "sensor_msgs/CompressedImage",
                header=header(self._zero_ns + view.timestamp.ToNanoseconds(), CAMERA), format=view.format,
                data=np.frombuffer(view.data, np.uint8),
            )
        ]  # fmt: skip

    def _outlines(self, data: bytes) -> list[Ros]:
        view = ImageAnnotations.FromString(data)
        if not view.points:
            return []
        stamp_ns = view.points[0].timestamp.ToNanoseconds()
        # a view's (0, 0) is the outer corner of the first pixel, ROS's its centre
        corners = np.array([[(p.x - 0.5, p.y - 0.5) for p in outline.points] for outline in view.points])
        tags = self._tags.get(stamp_ns, ())
        return [detection_array(header(self._zero_ns + stamp_ns, CAMERA), tags, corners)] if tags else []


def _scaled(centre: float, scale: float) -> float:
    """The principal point in a picture `scale` times as large; pixel centres are at integers."""
    return (centre + 0.5) * scale - 0.5
