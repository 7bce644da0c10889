"""The vehicle's recent odometry, looked up at a picture's exposure time."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from typing import NamedTuple

import numpy as np

from kernel.clip import usable
from kernel.stamps import later_than_now

_UNIT_NORM = 0.05  # deviation of a quaternion's norm from 1


class PoseAt(NamedTuple):
    """Interpolated vehicle state: position m and velocity m/s (world ENU), orientation wxyz (world from body FLU)."""

    position: np.ndarray
    velocity: np.ndarray
    orientation: np.ndarray
    body_rate: np.ndarray


class PoseHistory:
    """Keeps `span_ns` of odometry and interpolates linearly (orientation: normalised linear) between samples."""

    def __init__(self, span_ns: int = 1_000_000_000, extrapolate_ns: int = 30_000_000) -> None:
        self._span_ns, self._extrapolate_ns = span_ns, extrapolate_ns
        self._stamps: deque[int] = deque()
        self._poses: deque[PoseAt] = deque()

    def add(self, stamp_ns: int, pose: PoseAt, now_ns: int | None = None) -> bool:
        """Append a sample; False (and nothing kept) for one that cannot be used.

        That is one that is not finite, has no unit quaternion, or is not newer than the last; and one stamped later
        than `now_ns`, its time of arrival, as it would have all others refused until then.
        """
        if now_ns is not None and later_than_now(stamp_ns, now_ns):
            return False
        if self._stamps and stamp_ns <= self._stamps[-1]:
            return False
        if not all(usable(part) for part in pose) or abs(np.linalg.norm(pose.orientation) - 1.0) > _UNIT_NORM:
            return False
        self._stamps.append(stamp_ns)
        self._poses.append(pose)
        while self._stamps[0] < stamp_ns - self._span_ns:
            self._stamps.popleft()
            self._poses.popleft()
        return True

    def at(self, stamp_ns: int) -> PoseAt | None:
        """State at `stamp_ns`; None if it lies before the history or too far after the newest sample.

        A stamp just after the newest sample is extrapolated with that sample's twist.
        """
        if not self._stamps or stamp_ns < self._stamps[0]:
            return None
        i = bisect_right(self._stamps, stamp_ns) - 1
        a = self._poses[i]
        if i + 1 == len(self._stamps):
            ahead_ns = stamp_ns - self._stamps[i]
            if ahead_ns > self._extrapolate_ns:
                return None
            return _moved(a, ahead_ns * 1e-9)
        b = self._poses[i + 1]
        share = (stamp_ns - self._stamps[i]) / (self._stamps[i + 1] - self._stamps[i])
        orientation = (1 - share) * a.orientation + share * (b.orientation * np.sign(a.orientation @ b.orientation))
        return PoseAt(
            (1 - share) * a.position + share * b.position,
            (1 - share) * a.velocity + share * b.velocity,
            orientation / np.linalg.norm(orientation),
            (1 - share) * a.body_rate + share * b.body_rate,
        )


def _moved(pose: PoseAt, seconds: float) -> PoseAt:
    w, x, y, z = pose.orientation
    p, q, r = pose.body_rate
    rate = 0.5 * np.array(
        [-x * p - y * q - z * r, w * p + y * r - z * q, w * q - x * r + z * p, w * r + x * q - y * p],
    )
    orientation = pose.orientation + rate * seconds
    return PoseAt(
        pose.position + pose.velocity * seconds,
        pose.velocity,
        orientation / np.linalg.norm(orientation),
        pose.body_rate,
    )
