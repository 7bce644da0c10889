"""The car's pose by dead reckoning from its wheels, where nothing else measures it."""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import board_row
from groundcar.motion.kinematics import drive
from kernel.stamps import later_than_now

_LONGEST_S = 0.5  # without a report for longer the car is assumed to stand


class DeadReckoning:
    """Integrates speed and turn rate from a known pose. Skid steering makes the heading drift from the true one."""

    def __init__(self, pose: tuple[float, float, float], height: float, inclination: float) -> None:
        """`pose`: x, y (m) and heading (rad) at the start; `height` (m) and `inclination` (rad): the board's."""
        self._pose = pose
        self._speed = self._turn_rate = 0.0
        self._stamp_ns: int | None = None
        self._height, self._inclination = height, inclination

    def add(self, stamp_ns: int, speed: float, turn_rate: float, now_ns: int | None = None) -> None:
        """Add the car's report at `stamp_ns`: m/s, rad/s. A report that is not newer or not finite is ignored.

        So is one stamped later than `now_ns`, its time of arrival, as it would have all others ignored until then.
        """
        if not (math.isfinite(speed) and math.isfinite(turn_rate)):
            return
        if now_ns is not None and later_than_now(stamp_ns, now_ns):
            return
        if self._stamp_ns is not None:
            if stamp_ns <= self._stamp_ns:
                return
            self._pose = self._at(stamp_ns)
        self._stamp_ns, self._speed, self._turn_rate = stamp_ns, speed, turn_rate

    def board_row(self, now_ns: int) -> np.ndarray:
        """The board row (8,) of `groundcar.motion.board_motion` at `now_ns`, predicted from the last report."""
        x, y, heading = self._at(now_ns)
        row = np.zeros(board_row.DIM)
        row[board_row.X], row[board_row.Y], row[board_row.Z], row[board_row.HEADING] = x, y, self._height, heading
        row[board_row.SPEED], row[board_row.TURN_RATE], row[board_row.INCLINATION] = (
            self._speed,
            self._turn_rate,
            self._inclination,
        )
        return row

    def _at(self, now_ns: int) -> tuple[float, float, float]:
        if self._stamp_ns is None:
            return self._pose
        seconds = min(max(0.0, (now_ns - self._stamp_ns) * 1e-9), _LONGEST_S)
        x, y, heading = drive(*self._pose, self._speed, self._turn_rate, seconds)
        return float(x), float(y), float(heading)
