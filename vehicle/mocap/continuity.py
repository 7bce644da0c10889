"""Whether the poses of one body follow from each other as the body can have moved.

A system that takes other markers for the body's moves its pose by a decimetre or a metre at once. The body has not
moved, and what is driven by the pose must not answer to it. Jumps add up: once the pose has jumped back it is where the
body is, however long that took, and a pose that does not jump back stays wrong.

A system that has lost the body may send its last pose again and again, with new stamps. Two measured poses are never
equal to the last bit; those of a simulated system without noise are, on a body that stands.
"""

from __future__ import annotations

import math

Vec3 = tuple[float, float, float]

_REPEATS_NS = 200_000_000
JUMP = 0.3  # m: a shorter jump is taken for motion, and a pose this near to where the body must be for right


class Continuity:
    """One body; `add` is called with each of its poses, or with the newest ones."""

    def __init__(self, speed: float) -> None:
        """`speed`: m/s that the body does not reach."""
        self._speed = speed
        self._before: tuple[int, Vec3] | None = None
        self._off: Vec3 = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        """The next pose is taken as it is."""
        self._before, self._off = None, (0.0, 0.0, 0.0)

    def add(self, stamp_ns: int, position: Vec3) -> float:
        """By how far the pose (ns, m) is off what it was before it jumped, m; 0 if it is not.

        An equal or older stamp is compared as well: a body does not move within no time. A pose that repeats says
        nothing: the next one may be as far off as the body can have moved since it first came. Raises nothing; the
        numbers have to be finite.
        """
        before = self._before
        if before is None or position != before[1]:
            self._before = stamp_ns, position
        if before is not None:
            possible = self._speed * max(0, stamp_ns - before[0]) * 1e-9
            if math.dist(position, before[1]) > possible + JUMP:
                self._off = _sum(self._off, position, before[1])
        off = math.hypot(*self._off)
        if off <= JUMP:
            self._off = (0.0, 0.0, 0.0)
            return 0.0
        return off


class Repetition:
    """One body; `add` is called with each of its poses, or with the newest ones."""

    def __init__(self) -> None:
        self._newest: tuple[int, Vec3] | None = None
        self._since_ns = 0  # stamp of the first pose equal to the newest, and later than the last on a body at rest

    def add(self, stamp_ns: int, position: Vec3, moves: bool) -> bool:
        """Whether one pose (ns, m) has come for 0.2 s although the body `moves`, as is known by other means."""
        before = self._newest
        if before is None or position != before[1] or not moves:
            self._since_ns = stamp_ns
        if before is None or stamp_ns > before[0]:
            self._newest = stamp_ns, position
        return stamp_ns - self._since_ns >= _REPEATS_NS


def _sum(off: Vec3, position: Vec3, before: Vec3) -> Vec3:
    x, y, z = (o + p - b for o, p, b in zip(off, position, before, strict=True))
    return x, y, z
