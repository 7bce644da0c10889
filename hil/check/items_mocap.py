"""Automatic checks of motion capture: rate, age, and whether it describes this vehicle, this board and this car."""

from __future__ import annotations

import math

from hil.bench.devices import Context
from hil.bench.mocap import Pose
from hil.bench.reading import Unavailable
from hil.check.judge import Reading
from hil.check.registry import check
from kernel.rotations import swap_attitude
from vehicle.mocap.agreement import (
    BoardSetting,
    board_disagreement,
    heading_between,
    inclination_of,
    tilt_between,
    vehicle_disagreement,
)

_MOVED, _MOVED_SHARE = 0.06, 0.3  # m, and share of what the wheels moved
_TURNED, _TURNED_SHARE = math.radians(8.0), 0.5  # rad, and share: a skid-steered car slips


@check("mocap.rate", unit="Hz")
def rate(context: Context) -> Reading:
    """Poses a second from motion capture."""
    report = context.mocap()
    return Reading(report.rate_hz, f"longest gap {report.gap_ms:.1f} ms", report.source)


@check("mocap.age", unit="ms")
def age(context: Context) -> Reading:
    """Greatest age of the newest pose before the next one comes."""
    report = context.mocap()
    return Reading(report.age_ms, "", report.source)


@check("mocap.vehicle", unit="deg")
def vehicle(context: Context) -> Reading:
    """Angle between the vehicle's body in motion capture and its autopilot's attitude: tilt, which gravity gives."""
    report = context.mocap()
    seen, own = _seen(report.vehicle, "the vehicle"), swap_attitude(context.ground().latest("ODOMETRY").q)
    aligned = not context.rig.vehicle.external_pose
    why = vehicle_disagreement(seen.position, seen.orientation, own, context.rig.gate.reach, aligned)
    tilt, heading = tilt_between(seen.orientation, own), heading_between(seen.orientation, own)
    detail = why or (f"headings differ by {math.degrees(heading):.1f} deg" if aligned else "")
    return Reading(math.degrees(tilt), detail, report.source, ok=False if why else None)


@check("mocap.board", unit="deg")
def board(context: Context) -> Reading:
    """Inclination of the board's body in motion capture less the one the scenario sets (absolute); and its height."""
    report = context.mocap()
    seen = _seen(report.board, "the board")
    setting = BoardSetting(
        math.radians(context.scenario.board.inclination_deg), context.scenario.board.height, context.rig.gate.reach
    )
    why = board_disagreement(seen.position, seen.orientation, setting)
    off = abs(inclination_of(seen.orientation)[0] - setting.inclination)
    return Reading(math.degrees(off), why or f"{seen.position[2]:.2f} m high", report.source, ok=False if why else None)


@check("mocap.wheels", unit="deg")
def wheels(context: Context) -> Reading:
    """Tried: the car drives a curve for a second; its turn by motion capture less that of its wheels (absolute)."""
    found = context.curve()
    detail = (
        f"moved {found.moved:.2f} m and turned {math.degrees(found.turned):.0f} deg, by the wheels "
        f"{found.wheels_moved:.2f} m and {math.degrees(found.wheels_turned):.0f} deg"
    )
    off = abs(found.turned - found.wheels_turned)
    same_way = abs(found.moved - found.wheels_moved) <= _MOVED + _MOVED_SHARE * abs(found.wheels_moved)
    if same_way and off <= _TURNED + _TURNED_SHARE * abs(found.wheels_turned):
        return Reading(math.degrees(off), detail, found.source)
    return Reading(math.degrees(off), f"{detail}: is an axis swapped or mirrored?", found.source, ok=False)


def _seen(pose: Pose | None, what: str) -> Pose:
    if pose is None:
        raise Unavailable(f"motion capture does not see {what}")
    return pose
