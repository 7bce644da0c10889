"""Poses and transforms in Foxglove's schemas. One message is filled again and again: making one takes most of the
time that it costs."""

from __future__ import annotations

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

from hil.contract.messages import Quat, Vec3


class Transforms:
    """Transforms between pairs of frames: (parent, child)."""

    def __init__(self, *frames: tuple[str, str]) -> None:
        self._message = FrameTransforms()
        one = self._message.transforms.add
        found = [one(parent_frame_id=parent, child_frame_id=child) for parent, child in frames]
        self._parts = [(t.timestamp, t.translation, t.rotation) for t in found]

    def filled(self, stamp_ns: int, *poses: tuple[Vec3, Quat]) -> bytes:
        """As bytes with a translation (m) and a rotation (w, x, y, z) for each pair. Raises ValueError for a time that
        protobuf does not have."""
        for (time, v, q), (translation, rotation) in zip(self._parts, poses, strict=True):
            time.FromNanoseconds(stamp_ns)
            v.x, v.y, v.z = translation
            q.w, q.x, q.y, q.z = rotation
        return self._message.SerializeToString()


class Pose:
    """A pose in the world."""

    def __init__(self) -> None:
        self._message = PoseInFrame(frame_id="world")
        pose = self._message.pose
        self._parts = self._message.timestamp, pose.position, pose.orientation

    def filled(self, stamp_ns: int, position: Vec3, orientation: Quat) -> bytes:
        """As `Transforms.filled`."""
        time, v, q = self._parts
        time.FromNanoseconds(stamp_ns)
        v.x, v.y, v.z = position
        q.w, q.x, q.y, q.z = orientation
        return self._message.SerializeToString()
