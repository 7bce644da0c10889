"""The approach to the board as motion capture sees it: a vehicle that flies to where the board is not brakes while it
still can. Pure: no clock, no I/O.

A belief without a camera goes on at the board's last speed. A board that brakes meanwhile is nearer and comes faster.
"""

from __future__ import annotations

import math

from hil.contract.messages import Belief, BoardState, VehicleState
from hil.safety.dive import believed_position, closing_speed
from kernel.clip import usable
from kernel.stamps import later_than_now

_OFF = 0.15  # m: without a fault the belief is nearer to the board when it matters (240 flights with pictures)
_HARMLESS = 2.0  # m/s: a board that is met faster makes a flight unsafe (`hil/scoring/flight_class.py`)
_REACTION = 0.15  # s, until the vehicle has turned against its velocity
_BRAKING = 10.0  # m/s^2, less than 80 % of all thrust gives
_FRESH_NS = 200_000_000


def wrong_board(now_ns: int, vehicle: VehicleState | None, board: BoardState | None, believed: Belief | None) -> str:
    """Why the vehicle must brake now; empty if it need not, or if that is not known.

    `vehicle`, `board`: the newest samples of motion capture, world frame. From the closing speed v, braking to 2 m/s
    takes v 0.15 s + (v^2 - 4) / 20 m.
    """
    if vehicle is None or board is None or believed is None or not believed.valid:
        return ""
    stamps = vehicle.stamp_ns, board.stamp_ns
    if now_ns - min(stamps) > _FRESH_NS or later_than_now(max(stamps), now_ns):
        return ""
    if not usable((*vehicle.position, *vehicle.velocity, *board.position, *board.velocity)):
        return ""
    apart = [a - b for a, b in zip(vehicle.position, board.position, strict=True)]
    distance = math.hypot(*apart)
    moves = [a - b for a, b in zip(vehicle.velocity, board.velocity, strict=True)]
    closing = closing_speed(apart, moves)
    if closing <= _HARMLESS or distance > closing * _REACTION + (closing**2 - _HARMLESS**2) / (2.0 * _BRAKING):
        return ""
    off = math.dist(believed_position(believed, board.stamp_ns), board.position)
    if off <= _OFF:
        return ""
    return f"the board is {off:.2f} m off where it is believed to be, {distance:.1f} m ahead at {closing:.1f} m/s"
