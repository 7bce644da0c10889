"""Detected tags as apriltag_msgs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from hil.ros2.types import Ros, make, ros

TOPIC = "/camera/detections"
_SQUARE = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]], np.float32)  # the corners in the tag's own plane


def detection_array(header: Any, ids: Sequence[int], corners: np.ndarray) -> Ros:
    """apriltag_msgs/AprilTagDetectionArray: `corners` (tags, 4, 2) px, in the detector's order, centres at integers.

    What the detector does not tell (hamming distance, decision margin) is 0.
    """
    found = [_detection(int(tag), four) for tag, four in zip(ids, corners, strict=False) if np.isfinite(four).all()]
    return ros(TOPIC, "apriltag_msgs/AprilTagDetectionArray", header=header, detections=found)


def _detection(tag: int, corners: np.ndarray) -> Any:
    homography = cv2.getPerspectiveTransform(_SQUARE, corners.astype(np.float32))
    centre = homography[:2, 2] / (homography[2, 2] or 1.0)
    return make(
        "apriltag_msgs/AprilTagDetection", family="tag36h11", id=tag, hamming=0, goodness=0.0, decision_margin=0.0,
        centre=_point(centre), corners=[_point(corner) for corner in corners],
        homography=np.ascontiguousarray(homography, dtype=np.float64).reshape(9),
    )  # fmt: skip


def _point(xy: np.ndarray) -> Any:
    return make("apriltag_msgs/Point", x=float(xy[0]), y=float(xy[1]))
