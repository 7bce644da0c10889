"""Whether a command can be based on what a policy is given, and the answer where none can.

A broken number must not become a command: clipped, it would be the largest one. A policy returns `no_command` instead,
and the safety gate, which sees it unclipped, hands the vehicle back.
"""

from __future__ import annotations

import math

from kernel.clip import usable
from kernel.stamps import later_than_now
from policies.task.interface import BoardView, Command, VehicleView

_OLDEST_NS = 500_000_000  # odometry or belief; both come at 100 Hz, and are predicted to now
_UNIT_NORM = 0.05  # deviation of a quaternion's norm from 1


def why_unusable(now_ns: int, vehicle: VehicleView, board: BoardView) -> str:
    """Why no command can be based on these views at `now_ns`; empty if one can."""
    quaternion = vehicle.orientation
    if not usable((*vehicle.position, *vehicle.velocity, *quaternion, *vehicle.body_rate)):
        return "odometry is not finite"
    if abs(math.hypot(*quaternion) - 1.0) > _UNIT_NORM:
        return "odometry has no unit quaternion"
    board_numbers = (board.heading, board.speed, board.turn_rate, board.inclination, board.acceleration)
    if not usable((*board.position, *board_numbers, board.rho, board.surface_sigma, *board.variance)):
        return "belief is not finite"
    for what, stamp_ns in (("odometry", vehicle.stamp_ns), ("belief", board.stamp_ns)):
        if later_than_now(stamp_ns, now_ns):
            return f"{what} is stamped later than now"
        if now_ns - stamp_ns > _OLDEST_NS:
            return f"{what} is older than {_OLDEST_NS * 1e-9:g} s"
    if later_than_now(board.last_exposure_ns, now_ns):
        return "belief's newest picture is stamped later than now"
    return ""


def no_command(engaged: bool, why: str) -> Command:
    """The answer where no command can be given: NaN, on which the gate trips; not `engaged`, the driver's hover.

    The recording has the reason as the command's phase.
    """
    return Command(engaged, (math.nan, math.nan, math.nan), math.nan, f"no command: {why}", 1.0)
