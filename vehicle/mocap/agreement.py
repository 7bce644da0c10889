"""Whether motion capture describes this vehicle, this board and this world, by what else is known of them.

Gravity tells the autopilot how the vehicle is tilted, the scenario sets how the board is inclined and how high it is,
the fence says where both can be, and the wheels how the car moves. Swapped or mirrored axes, millimetres in place of
metres, and another body each contradict one of these. Angles in rad; positions m and quaternions wxyz (world from
body) of a world with z up.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from kernel.clip import clip
from kernel.rotations import body_z, yaw

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

TILT = math.radians(10.0)  # of the vehicle, against the autopilot's; of the board, against its set inclination
HEADING = math.radians(25.0)
_HEIGHT = 0.3  # m, of the board against its set height
_SPEED, _SPEED_SHARE = 0.4, 0.4  # m/s, and share of the wheels' speed
_TURNING = 0.3  # rad/s: slower turns are not compared, as a skid-steered car slips


class BoardSetting(NamedTuple):
    """How the board is set, and the largest coordinate inside the fence."""

    inclination: float  # rad
    height: float  # m, of its centre
    reach: float  # m


def tilt_between(seen: Quat, own: Quat) -> float:
    """Angle between the body z axes of two attitudes, 0 to pi."""
    return math.acos(clip(sum(a * b for a, b in zip(body_z(seen), body_z(own), strict=True)), -1.0, 1.0))


def heading_between(seen: Quat, own: Quat) -> float:
    """Angle between the headings of two attitudes, 0 to pi."""
    return abs((yaw(seen) - yaw(own) + math.pi) % (2.0 * math.pi) - math.pi)


def inclination_of(board: Quat) -> tuple[float, float]:
    """(inclination up the board's x axis, tilt of its y axis, which is level on a car)."""
    w, x, y, z = board
    inclined = math.atan2(2.0 * (x * z - w * y), 1.0 - 2.0 * (x * x + y * y))
    return inclined, math.asin(clip(2.0 * (y * z + w * x), -1.0, 1.0))


def vehicle_disagreement(position: Vec3, seen: Quat, own: Quat, reach: float, has_heading: bool = True) -> str:
    """Why the vehicle's pose cannot be that of the vehicle at rest whose autopilot has the attitude `own`; or empty.

    `reach` m: the largest coordinate inside the fence. `has_heading`: the autopilot knows its heading, which one that
    takes it from motion capture does not before it is given poses.
    """
    if far := _far(position, reach):
        return far
    tilt, heading = tilt_between(seen, own), heading_between(seen, own)
    if tilt > TILT:
        return (
            f"it is tilted by {math.degrees(tilt):.0f} deg against the autopilot's attitude, which gravity gives: "
            "are axes swapped, or is it another body?"
        )
    if has_heading and heading > HEADING:
        return (
            f"its heading is {math.degrees(heading):.0f} deg off the autopilot's: are axes swapped or mirrored, or is "
            "the body's x axis not its front?"
        )
    return ""


def board_disagreement(position: Vec3, seen: Quat, setting: BoardSetting) -> str:
    """Why the board's pose cannot be that of a board set like that on a car; or empty."""
    inclination, height, reach = setting
    if far := _far(position, reach):
        return far
    inclined, rolled = inclination_of(seen)
    if abs(inclined - inclination) > TILT or abs(rolled) > TILT:
        return (
            f"it is inclined by {math.degrees(inclined):.0f} deg and rolled by {math.degrees(rolled):.0f} deg, set are "
            f"{math.degrees(inclination):.0f} and 0 deg: are axes swapped, or is it another body?"
        )
    if abs(position[2] - height) > _HEIGHT:
        return (
            f"its centre is {position[2]:.2f} m high, set are {height:g} m: is the world's origin on the ground, or is "
            "it another body?"
        )
    return ""


def motion_disagreement(speed: float, turn_rate: float, wheel_speed: float, wheel_turn_rate: float) -> str:
    """Why the board's motion cannot be that of the car with these wheels; or empty. m/s along the heading, rad/s."""
    if abs(speed - wheel_speed) > _SPEED + _SPEED_SHARE * abs(wheel_speed):
        return (
            f"it moves at {speed:.2f} m/s along its heading, the car's wheels at {wheel_speed:.2f} m/s: are axes "
            "swapped or units wrong, or is it another body?"
        )
    if min(abs(turn_rate), abs(wheel_turn_rate)) > _TURNING and turn_rate * wheel_turn_rate < 0.0:
        return (
            f"it turns at {turn_rate:.2f} rad/s, the car's wheels at {wheel_turn_rate:.2f} rad/s: is an axis mirrored?"
        )
    return ""


def _far(position: Vec3, reach: float) -> str:
    if all(abs(value) <= reach for value in position):
        return ""
    place = ", ".join(f"{value:.1f}" for value in position)
    return f"it is at ({place}) m, the fence ends at {reach:g} m: does the system stream millimetres?"


class Lasting:
    """A finding that counts once it has been made at every time for a while."""

    def __init__(self, duration_ns: int) -> None:
        self._duration_ns = duration_ns
        self._since_ns: int | None = None

    def add(self, now_ns: int, found: bool) -> bool:
        """Whether it has lasted long enough; `found`: whether it is made now."""
        if not found:
            self._since_ns = None
            return False
        self._since_ns = now_ns if self._since_ns is None else self._since_ns
        return now_ns - self._since_ns >= self._duration_ns
