"""The dive at the board, by belief and odometry: there what fails has to be found in a tenth of a second.

Pure: no clock, no I/O.

A vehicle that dives at up to 4 m/s and begins to brake within 0.1 s meets the board at less than 2 m/s from wherever it
begins; after 0.2 s it does not from some places (docs/limitations.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from hil.contract.messages import Belief, VehicleState
from kernel.rotations import rotate

_FROM, _TO = 1.4, 0.3  # m from the board's centre; nearer nothing can be done
_CLOSING = 1.5  # m/s: a slower vehicle does the board no harm
_MOVES = 0.5  # m/s: a slower board is where it was seen
SILENCE_NS = 120_000_000  # without a command, or with one that repeats; a policy of 10 Hz repeats each for 100 ms

# A policy may turn its camera away from the board for most of the dive: Normal-I was flown blind from 3.5 m on, saw the
# board again at 0.8 to 0.65 m and perched. Wherever the camera looked at the believed board it was seen every 90 ms.
_UNSEEN_NS = 150_000_000
_SEEN_FROM = 0.6  # m: nearer the board must be seen; from 0.5 m on braking can come too late
_LOOKED_FROM = 2.0  # m: nearer it must be seen where the camera looks at it
_LOOKED_COS = math.cos(math.radians(18.0))  # of the angle between optical axis and board: well in the picture


def diving(now_ns: int, vehicle: VehicleState | None, board: Belief | None, within: float = _FROM) -> float:
    """The distance to the board (m) of a vehicle that dives at it, less than `within`; 0 if it does not, or if that is
    not known."""
    if vehicle is None or board is None or not board.valid:
        return 0.0
    apart = _apart(now_ns, vehicle, board)
    distance = math.hypot(*apart)
    if not _TO < distance < within:
        return 0.0
    vx, vy = board.speed * math.cos(board.heading), board.speed * math.sin(board.heading)
    moves = [a - b for a, b in zip(vehicle.velocity, (vx, vy, 0.0), strict=True)]
    return distance if closing_speed(apart, moves) > _CLOSING else 0.0


def closing_speed(apart: Sequence[float], moves: Sequence[float]) -> float:
    """How fast the distance shrinks, m/s, of a body that is `apart` (m) from another and `moves` (m/s) against it."""
    distance = math.hypot(*apart)
    return -sum(a * b for a, b in zip(moves, apart, strict=True)) / distance if distance else 0.0


def believed_position(board: Belief, stamp_ns: int) -> tuple[float, float, float]:
    """Where the board is at `stamp_ns`, as it is believed to move: m, world."""
    passed = (stamp_ns - board.stamp_ns) * 1e-9
    x, y, z = board.position
    return (
        x + board.speed * math.cos(board.heading) * passed,
        y + board.speed * math.sin(board.heading) * passed,
        z,
    )


class Lookout:
    """Whether a vehicle that dives at a moving board sees it where it must: one that it does not see is not where it is
    believed to be."""

    def __init__(self, camera_tilt: float | None) -> None:
        """`camera_tilt`: rad below the body's x axis; None: the board is not known by a camera."""
        self._axis = None if camera_tilt is None else (math.cos(camera_tilt), 0.0, -math.sin(camera_tilt))
        self._exposure_ns = self._since_ns = 0  # of the newest sighting; since when the camera looks in vain

    def unseen(self, now_ns: int, vehicle: VehicleState | None, board: Belief | None) -> str:
        """Why the vehicle must not dive on; empty if it may."""
        if vehicle is None or board is None or not board.valid:
            return ""
        if board.last_exposure_ns != self._exposure_ns or not self._looks_at(now_ns, vehicle, board):
            self._exposure_ns, self._since_ns = board.last_exposure_ns, now_ns
        distance = diving(now_ns, vehicle, board, _LOOKED_FROM)
        if not distance or abs(board.speed) < _MOVES:
            return ""
        blind_ns = now_ns - board.last_exposure_ns
        if now_ns - self._since_ns > _UNSEEN_NS or (distance < _SEEN_FROM and blind_ns > _UNSEEN_NS):
            return f"board not seen for {blind_ns * 1e-9:.2f} s, {distance:.1f} m in front of it"
        return ""

    def _looks_at(self, now_ns: int, vehicle: VehicleState, board: Belief) -> bool:
        if self._axis is None:
            return False
        apart = _apart(now_ns, vehicle, board)
        axis = rotate(vehicle.orientation, *self._axis)
        return -sum(a * b for a, b in zip(axis, apart, strict=True)) > _LOOKED_COS * math.hypot(*apart)


def _apart(now_ns: int, vehicle: VehicleState, board: Belief) -> list[float]:
    """From where the board is believed to be now to the vehicle: m, world."""
    return [a - b for a, b in zip(vehicle.position, believed_position(board, now_ns), strict=True)]
