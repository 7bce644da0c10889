"""Commands to a Crazyflie as packets, and back: set-points, the high-level commander, external poses, supervisor.

World ENU and body FLU here. The wire differs: pitch is positive nose up there, which is minus FLU, and so is the legacy
set-point's yaw rate. Source: the firmware's decoders of ports 3, 6, 7 and 8.
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from vehicle.crazyflie.crtp import Packet, Port, SupervisorChannel, SupervisorCommand

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

FULL_WORD = 65535  # thrust word of all that the firmware can ask of its motors

# Kinds of a set-point on Port.SETPOINT_GENERIC, channel 0.
STOP, POSITION, VELOCITY, MANUAL = 0, 7, 8, 11
# Commands of Port.HIGH_LEVEL.
SET_GROUP, HL_STOP, GO_TO, TAKEOFF, LAND = 0, 3, 12, 7, 8
EXTERNAL_POSITION_CHANNEL, LOCALIZATION_CHANNEL, EXTERNAL_POSE = 0, 1, 8
OLD_EMERGENCY_STOP, OLD_EMERGENCY_STOP_WATCHDOG = 3, 4

_LEGACY = struct.Struct("<fffH")
_MANUAL = struct.Struct("<BfffHB")
_FOUR = struct.Struct("<Bffff")
_VERTICAL = struct.Struct("<BBff?f")
_GO_TO = struct.Struct("<BBBBfffff")
_POSE = struct.Struct("<B7f")
_POSITION = struct.Struct("<fff")


class Rates(NamedTuple):
    """Body rates (rad/s, FLU) and a thrust word (0..65535)."""

    body_rate: Vec3
    word: int


class Attitude(NamedTuple):
    """Roll and pitch (rad, FLU), yaw rate (rad/s) and a thrust word."""

    roll: float
    pitch: float
    yaw_rate: float
    word: int


class Position(NamedTuple):
    """A position (m) and a heading (rad), world; NaN where only a velocity is set."""

    position: Vec3
    velocity: Vec3
    yaw: float
    yaw_rate: float


class Stop(NamedTuple):
    """Motors off."""


class Vertical(NamedTuple):
    """Take-off or landing to `height` (m, world) in `duration` s; `yaw` (rad), None: as it is."""

    landing: bool
    height: float
    yaw: float | None
    duration: float


class GoTo(NamedTuple):
    """To a position (m) and heading (rad) in `duration` s."""

    relative: bool
    position: Vec3
    yaw: float
    duration: float


Setpoint = Rates | Attitude | Position | Stop


def rates(command: Rates) -> Packet:
    """A rate set-point (kind manual)."""
    p, q, r = (math.degrees(rate) for rate in command.body_rate)
    return Packet(Port.SETPOINT_GENERIC, 0, _MANUAL.pack(MANUAL, p, -q, r, command.word, 1))


def stop() -> Packet:
    """The set-point that stops the motors at once."""
    return Packet(Port.SETPOINT_GENERIC, 0, bytes((STOP,)))


def relax() -> Packet:
    """Set-points end here: the high-level commander may fly again (notify set-point stop)."""
    return Packet(Port.SETPOINT_GENERIC, 1, struct.pack("<BI", 0, 0))


def vertical(command: Vertical) -> Packet:
    """A take-off or landing of the high-level commander."""
    number = LAND if command.landing else TAKEOFF
    yaw = 0.0 if command.yaw is None else command.yaw
    data = _VERTICAL.pack(number, 0, command.height, yaw, command.yaw is None, command.duration)
    return Packet(Port.HIGH_LEVEL, 0, data)


def go_to(command: GoTo) -> Packet:
    """A flight to a place, of the high-level commander."""
    data = _GO_TO.pack(GO_TO, 0, command.relative, False, *command.position, command.yaw, command.duration)
    return Packet(Port.HIGH_LEVEL, 0, data)


def external_pose(position: Vec3, orientation: Quat) -> Packet:
    """A pose for the estimator: m (world), quaternion w x y z (world from body)."""
    w, x, y, z = orientation
    return Packet(Port.LOCALIZATION, LOCALIZATION_CHANNEL, _POSE.pack(EXTERNAL_POSE, *position, x, y, z, w))


def supervisor(command: SupervisorCommand, *values: int) -> Packet:
    """A command to the supervisor."""
    return Packet(Port.SUPERVISOR, SupervisorChannel.COMMAND, bytes((command, *values)))


def read_legacy(data: bytes, rate_mode: tuple[bool, bool, bool]) -> Setpoint | None:
    """Port.SETPOINT: roll, pitch (deg or deg/s by `rate_mode`), yaw rate (deg/s), thrust word. None if malformed."""
    if len(data) != _LEGACY.size:
        return None
    roll, pitch, yaw, word = _LEGACY.unpack(data)
    p, q, r = math.radians(roll), -math.radians(pitch), -math.radians(yaw)
    if not all(map(math.isfinite, (p, q, r))):
        return None
    return Rates((p, q, r), word) if rate_mode[0] and rate_mode[1] else Attitude(p, q, r, word)


def read_generic(data: bytes) -> Setpoint | None:
    """Port.SETPOINT_GENERIC, channel 0. None for malformed data and for kinds that are not simulated here."""
    kind = data[0] if data else -1
    if kind == STOP:
        return Stop()
    if kind == MANUAL and len(data) == _MANUAL.size:
        _, roll, pitch, yaw, word, rate = _MANUAL.unpack(data)
        p, q, r = math.radians(roll), -math.radians(pitch), math.radians(yaw)
        if not all(map(math.isfinite, (p, q, r))):
            return None
        return Rates((p, q, r), word) if rate else Attitude(p, q, r, word)
    if kind in (POSITION, VELOCITY) and len(data) == _FOUR.size:
        _, x, y, z, turn = _FOUR.unpack(data)
        if not all(map(math.isfinite, (x, y, z, turn))):
            return None
        turn, nothing = math.radians(turn), (math.nan, math.nan, math.nan)
        if kind == POSITION:
            return Position((x, y, z), nothing, turn, math.nan)
        return Position(nothing, (x, y, z), math.nan, turn)
    return None


def read_high_level(data: bytes) -> Vertical | GoTo | Stop | None:
    """Port.HIGH_LEVEL; None for malformed data and for commands that are not simulated here."""
    kind = data[0] if data else -1
    if kind == HL_STOP:
        return Stop()
    if kind in (TAKEOFF, LAND) and len(data) == _VERTICAL.size:
        _, _, height, yaw, keep, duration = _VERTICAL.unpack(data)
        return Vertical(kind == LAND, height, None if keep else yaw, duration)
    if kind == GO_TO and len(data) == _GO_TO.size:
        _, _, relative, _, x, y, z, yaw, duration = _GO_TO.unpack(data)
        return GoTo(bool(relative), (x, y, z), yaw, duration)
    return None


def read_external(packet: Packet) -> tuple[Vec3, Quat | None] | None:
    """Position (m) and quaternion (w x y z; None where there is none) from Port.LOCALIZATION; None if malformed."""
    data = packet.data
    if packet.channel == EXTERNAL_POSITION_CHANNEL and len(data) == _POSITION.size:
        x, y, z = _POSITION.unpack(data)
        return (x, y, z), None
    if packet.channel == LOCALIZATION_CHANNEL and len(data) == _POSE.size and data[0] == EXTERNAL_POSE:
        _, x, y, z, qx, qy, qz, qw = _POSE.unpack(data)
        return (x, y, z), (qw, qx, qy, qz)
    return None
