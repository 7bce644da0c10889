"""Velocity and body rate from motion capture poses: the slope, at the newest pose, of a parabola through the last few.

A straight line would give the motion of half a window ago, which at 10 m/s^2 is wrong by a third of a metre per second;
the parabola's slope is wrong only by the change of the acceleration.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from kernel.clip import usable
from kernel.rotations import conjugate, multiply, to_rotation_vector
from kernel.stamps import later_than_now

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

SAMPLES = 8
GAP_NS = 100_000_000  # poses further apart than this are not used together


class BodyMotion:
    """One body. Velocity and body rate are zero until three poses are known."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, Vec3, Quat]] = deque(maxlen=SAMPLES)

    def add(
        self, stamp_ns: int, position: Vec3, orientation: Quat, now_ns: int | None = None
    ) -> tuple[Vec3, Vec3] | None:
        """Velocity (m/s, world) and body rate (rad/s, body) at this newest pose: m (world), wxyz (world from body).

        None for a pose that is not finite, no rotation, or not newer than the last one; and for one stamped later than
        `now_ns`, its time of arrival, as it would have all others refused until then.
        """
        if not usable((*position, *orientation)) or not 0.9 < math.hypot(*orientation) < 1.1:
            return None
        if now_ns is not None and later_than_now(stamp_ns, now_ns):
            return None
        if self._poses:
            passed = stamp_ns - self._poses[-1][0]
            if passed <= 0:
                return None
            if passed > GAP_NS:
                self._poses.clear()
        self._poses.append((stamp_ns, position, orientation))
        if len(self._poses) < 3:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        times = np.array([(stamp - stamp_ns) * 1e-9 for stamp, _, _ in self._poses])
        back = conjugate(orientation)
        rows = np.array(
            [(*p, *to_rotation_vector(_near(multiply(back, q)))) for _, p, q in self._poses]
        )  # displacement and rotation relative to the newest pose
        scale = float(-times[0])
        design = np.stack([np.ones_like(times), times / scale, (times / scale) ** 2], axis=1)
        slope = np.linalg.lstsq(design, rows, rcond=None)[0][1] / scale
        vx, vy, vz, p, q, r = map(float, slope)
        return (vx, vy, vz), (p, q, r)


def _near(q: Quat) -> Quat:
    """The quaternion of this rotation with w >= 0, a rotation of at most half a turn."""
    return q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
