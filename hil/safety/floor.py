"""Whether the vehicle has come down without its autopilot's knowledge. Pure: no clock, no I/O.

An autopilot stops the motors once it has detected its landing, which it cannot with a sensor that failed: a real PX4
with a dead gyro hops over the floor with its motors running. Motion capture sees that it is down.
"""

from __future__ import annotations

from hil.contract.messages import VehicleState

# PX4 needs 3 s from there to disarm, 1 m of drift of its estimate 1.5 s more (MPC_LAND_SPEED, COM_DISARM_LAND)
DOWN_NS = 8_000_000_000
_HEIGHT = 0.4  # m above the floor, of the body's origin: less than a board's
_GAP_NS = 500_000_000  # between two samples


class FloorWatch:
    """`add` is called while the vehicle is armed and the autopilot has to land it; one pose repeated says nothing."""

    def __init__(self) -> None:
        self._newest: VehicleState | None = None
        self._since_ns = 0  # stamp from which on it has been down

    def add(self, seen: VehicleState | None) -> bool:
        """Whether it has been down for 8 s; `seen`: the newest sample of motion capture (floor: z = 0)."""
        before = self._newest
        if seen is None or (before is not None and seen.stamp_ns <= before.stamp_ns):
            return False
        self._newest = seen
        follows = before is not None and seen.stamp_ns - before.stamp_ns <= _GAP_NS and seen.position != before.position
        if not follows or not abs(seen.position[2]) <= _HEIGHT:  # nor is one down whose height is not finite
            self._since_ns = seen.stamp_ns
            return False
        return seen.stamp_ns - self._since_ns >= DOWN_NS
