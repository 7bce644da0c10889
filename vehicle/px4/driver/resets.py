"""Resets of the autopilot's estimate (ODOMETRY.reset_counter): what jumped, by how much, and whether that matters.

PX4 resets its heading once after each take-off, when it has left the magnetic disturbance of the ground, and small
corrections count as resets too. A driver on its way to the hover settles there again; later each jump is an error of
what a policy flies on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vehicle.px4.driver.types import Note, Odometry, Quat

_PAUSE_NS = 1_000_000_000  # between two texts
_LONGEST_S = 0.1  # between two samples: longer, and the motion between them is not known


class Reset(NamedTuple):
    """By how much position (m), velocity (m/s) and attitude (rad) changed without a motion."""

    position: float
    velocity: float
    attitude: float

    @property
    def text(self) -> str:
        return (
            f"the autopilot's estimate was reset by {self.position:.2f} m, {self.velocity:.2f} m/s, "
            f"{math.degrees(self.attitude):.1f} deg"
        )


ON_THE_WAY = Reset(0.5, 1.0, math.radians(45.0))  # more than this is worth a warning before the hover
FROM_THE_HOVER_ON = Reset(0.05, 0.3, math.radians(2.0))


def reset_between(before: Odometry, after: Odometry) -> Reset | None:
    """What changed between two samples beyond the motion that they tell; None if they are too far apart in time."""
    seconds = (after.stamp_ns - before.stamp_ns) * 1e-9
    if not 0.0 < seconds <= _LONGEST_S:
        return None
    expected = [p + v * seconds for p, v in zip(before.position, before.velocity, strict=True)]
    turning = math.hypot(*before.body_rate) * seconds
    attitude = max(0.0, _angle(before.orientation, after.orientation) - turning)
    return Reset(math.dist(after.position, expected), math.dist(after.velocity, before.velocity), attitude)


def note_of(reset: Reset | None, *, hovering: bool) -> Note:
    """The crew's text: a warning if more jumped than is harmless in this phase of the flight, else an information."""
    if reset is None:
        return Note("warning", "the autopilot's estimate was reset while no odometry came")
    limits = FROM_THE_HOVER_ON if hovering else ON_THE_WAY
    matters = any(value > limit for value, limit in zip(reset, limits, strict=True))
    return Note("warning" if matters else "info", reset.text)


class ResetNotes:
    """The crew's texts of one flight.

    An estimator without a sensor resets itself ten times a second. Within a second of one that was told only those are
    told that jumped twice as much, or that are a warning where it was none; the next text counts the others.
    """

    def __init__(self) -> None:
        self._told: Reset | None = None
        self._warned = False  # what was told last was a warning
        self._told_ns: int | None = None
        self._untold = 0

    def take(self, now_ns: int, resets: Sequence[Reset | None], *, hovering: bool) -> list[Note]:
        """What is to be told of the newest resets; `hovering` as in `note_of`."""
        notes = []
        for reset in resets:
            note = note_of(reset, hovering=hovering)
            warns = note.severity == "warning"
            more = _larger(reset, self._told) or (warns and not self._warned)
            if self._told_ns is not None and now_ns - self._told_ns < _PAUSE_NS and not more:
                self._untold += 1
                continue
            if self._untold:
                note = Note(note.severity, f"{note.text}; {self._untold} since the one before")
            notes.append(note)
            self._told, self._warned, self._told_ns, self._untold = reset, warns, now_ns, 0
        return notes


def _larger(reset: Reset | None, told: Reset | None) -> bool:
    """Whether a reset is twice as much as `told`; one that could not be measured is more than any other."""
    if reset is None or told is None:
        return told is not None
    return _much(reset) > 2.0 * _much(told)


def _much(reset: Reset) -> float:
    """How far it lies beyond what is harmless: 1 is harmless yet."""
    return max(value / limit for value, limit in zip(reset, FROM_THE_HOVER_ON, strict=True))


def _angle(a: Quat, b: Quat) -> float:
    """rad; not `kernel.rotations.angle_between`: a kernel that is loaded in flight delays a command."""
    return 2.0 * math.acos(min(1.0, abs(sum(x * y for x, y in zip(a, b, strict=True)))))
