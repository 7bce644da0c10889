"""ROS 2 message types: the standard ones as `rosbags` brings them, those of apriltag_msgs, and small parts of both."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hil.contract.messages import Quat

# apriltag_msgs 2.0, as ROS 2 Humble and Jazzy install it
_APRILTAG = {
    "apriltag_msgs/msg/Point": "float64 x\nfloat64 y\n",
    "apriltag_msgs/msg/AprilTagDetection": (
        "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n"
        "apriltag_msgs/Point centre\napriltag_msgs/Point[4] corners\nfloat64[9] homography\n"
    ),
    "apriltag_msgs/msg/AprilTagDetectionArray": (
        "std_msgs/Header header\napriltag_msgs/AprilTagDetection[] detections\n"
    ),
}
_SECOND_NS = 1_000_000_000
_LATEST_NS = 2**31 * _SECOND_NS - 1


class Ros(NamedTuple):
    """One ROS message: its topic, its type such as nav_msgs/msg/Odometry, its content."""

    topic: str
    kind: str
    content: Any


@cache
def typestore() -> Any:
    """Every type that an export uses, and their binary form (CDR)."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _APRILTAG.items():
        store.register(get_types_from_msg(text, name))
    return store


def make(kind: str, **fields: Any) -> Any:
    """A message of `kind`, such as geometry_msgs/Point."""
    return typestore().types[kind.replace("/", "/msg/")](**fields)


def ros(topic: str, kind: str, **fields: Any) -> Ros:
    """A message on a topic."""
    return Ros(topic, kind.replace("/", "/msg/"), make(kind, **fields))


def header(stamp_ns: int, frame: str) -> Any:
    """std_msgs/Header; `stamp_ns` since 1970."""
    return make("std_msgs/Header", stamp=time(stamp_ns), frame_id=frame)


def time(stamp_ns: int) -> Any:
    """builtin_interfaces/Time; a stamp that it cannot hold is its least or greatest, 1970 or 2038."""
    seconds, rest = divmod(min(max(0, stamp_ns), _LATEST_NS), _SECOND_NS)
    return make("builtin_interfaces/Time", sec=seconds, nanosec=rest)


def vector(xyz: Sequence[float]) -> Any:
    """geometry_msgs/Vector3."""
    return make("geometry_msgs/Vector3", x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))


def quaternion(wxyz: Quat) -> Any:
    """geometry_msgs/Quaternion of one that is w, x, y, z."""
    w, x, y, z = wxyz
    return make("geometry_msgs/Quaternion", x=float(x), y=float(y), z=float(z), w=float(w))


def pose(position: Sequence[float], wxyz: Quat) -> Any:
    """geometry_msgs/Pose."""
    point = make("geometry_msgs/Point", x=float(position[0]), y=float(position[1]), z=float(position[2]))
    return make("geometry_msgs/Pose", position=point, orientation=quaternion(wxyz))


def pose_with_covariance(position: Sequence[float], wxyz: Quat, covariance: np.ndarray | None = None) -> Any:
    """geometry_msgs/PoseWithCovariance; `covariance` (6, 6): x, y, z, then turns about the fixed x, y, z axes."""
    return make("geometry_msgs/PoseWithCovariance", pose=pose(position, wxyz), covariance=_flat(covariance))


def twist(linear: Sequence[float], angular: Sequence[float]) -> Any:
    """geometry_msgs/Twist."""
    return make("geometry_msgs/Twist", linear=vector(linear), angular=vector(angular))


def twist_with_covariance(linear: Sequence[float], angular: Sequence[float]) -> Any:
    """geometry_msgs/TwistWithCovariance whose covariance is unknown (zero)."""
    return make("geometry_msgs/TwistWithCovariance", twist=twist(linear, angular), covariance=_flat(None))


def _flat(covariance: np.ndarray | None) -> np.ndarray:
    return np.zeros(36) if covariance is None else np.ascontiguousarray(covariance, dtype=np.float64).reshape(36)
