"""Whether the vehicle dives at the board, by belief and odometry: there what fails has to be found in a tenth of a
second. Pure: no clock, no I/O.

A vehicle that dives at up to 4 m/s and begins to brake within 0.1 s meets the board at less than 2 m/s from wherever it
begins; after 0.2 s it does not from some places (docs/limitations.md).
"""

from __future__ import annotations

import math

from hil.contract.messages import Belief, VehicleState

_FROM, _TO = 1.4, 0.3  # m from the board's centre: further off a policy may look away; nearer nothing can be done
_CLOSING = 1.5  # m/s: a slower vehicle does the board no harm
_UNSEEN_S = 0.15  # in such dives the board is seen at least every 60 ms
_MOVES = 0.5  # m/s: a slower board is where it was seen
SILENCE_NS = 120_000_000  # without a command, or with one that repeats; a policy of 10 Hz repeats each for 100 ms


def diving(now_ns: int, vehicle: VehicleState | None, board: Belief | None) -> float:
    """The distance to the board (m) of a vehicle that dives at it; 0 if it does not, or if that is not known."""
    if vehicle is None or board is None or not board.valid:
        return 0.0
    vx, vy = board.speed * math.cos(board.heading), board.speed * math.sin(board.heading)
    passed = (now_ns - board.stamp_ns) * 1e-9
    x, y, z = board.position
    apart = [a - b for a, b in zip(vehicle.position, (x + vx * passed, y + vy * passed, z), strict=True)]
    distance = math.hypot(*apart)
    if not _TO < distance < _FROM:
        return 0.0
    moves = [a - b for a, b in zip(vehicle.velocity, (vx, vy, 0.0), strict=True)]
    closing = -sum(a * b for a, b in zip(moves, apart, strict=True)) / distance
    return distance if closing > _CLOSING else 0.0


def unseen(now_ns: int, vehicle: VehicleState | None, board: Belief | None) -> str:
    """Why a vehicle must not dive on: a moving board that it does not see is not where it is believed to be."""
    distance = diving(now_ns, vehicle, board)
    if not distance or board is None or abs(board.speed) < _MOVES:
        return ""
    blind = (now_ns - board.last_exposure_ns) * 1e-9
    return f"board not seen for {blind:.2f} s, {distance:.1f} m in front of it" if blind > _UNSEEN_S else ""
