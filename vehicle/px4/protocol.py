"""MAVLink as PX4 and its clients use it: modes, commands, masks, constants. Shared by simulator and driver.

Import MAVLink through this module only: it sets MAVLINK20 before pymavlink is imported, and selects the dialect with
every message that PX4 v1.17 sends by default. Framing itself is in `codec.py`.
"""

from __future__ import annotations

import os
from enum import IntEnum
from functools import lru_cache

os.environ.setdefault("MAVLINK20", "1")

from pymavlink.dialects.v20 import development as mavlink

__all__ = ["mavlink"]

PX4_SYSTEM, PX4_COMPONENT = 1, 1
AUTOPILOT_PX4, TYPE_QUADROTOR = 12, 2

FORCE_MAGIC = 21196  # COMPONENT_ARM_DISARM param2
PREARM_CHECK = 0x10000000  # SYS_STATUS health bit: may be armed
STATUSTEXT_CHUNK = 50


class Main(IntEnum):
    """Main mode, bits 16..23 of custom_mode."""

    MANUAL = 1
    ALTCTL = 2
    POSCTL = 3
    AUTO = 4
    ACRO = 5
    OFFBOARD = 6
    STABILIZED = 7


class Auto(IntEnum):
    """Sub mode of AUTO, bits 24..31 of custom_mode."""

    READY = 1
    TAKEOFF = 2
    LOITER = 3
    MISSION = 4
    RTL = 5
    LAND = 6


class Command(IntEnum):
    """Commands (MAV_CMD) that PX4 or its clients use here."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_LOITER_TO_ALT = 31
    DO_ORBIT = 34
    NAV_DELAY = 93
    DO_SET_MODE = 176
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_FLIGHTTERMINATION = 185
    DO_REPOSITION = 192
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    MISSION_START = 300
    COMPONENT_ARM_DISARM = 400
    INJECT_FAILURE = 420
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_PROTOCOL_VERSION = 519
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001


class Result(IntEnum):
    """COMMAND_ACK.result."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5


class State(IntEnum):
    """HEARTBEAT.system_status."""

    UNINIT = 0
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    FLIGHT_TERMINATION = 8


class BaseMode(IntEnum):
    """Bits of HEARTBEAT.base_mode."""

    CUSTOM = 1
    AUTO = 4
    GUIDED = 8
    STABILIZE = 16
    HIL = 32
    MANUAL_INPUT = 64
    ARMED = 128


class MissionState(IntEnum):
    """MISSION_CURRENT.mission_state."""

    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


class MissionResult(IntEnum):
    """MISSION_ACK.type."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    CANCELLED = 15


class Landed(IntEnum):
    """EXTENDED_SYS_STATE.landed_state."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class Severity(IntEnum):
    """STATUSTEXT.severity."""

    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class AttitudeMask(IntEnum):
    """Bits of SET_ATTITUDE_TARGET.type_mask: what to ignore."""

    ROLL_RATE = 1
    PITCH_RATE = 2
    YAW_RATE = 4
    THROTTLE = 64
    ATTITUDE = 128


class PositionMask(IntEnum):
    """Bits of SET_POSITION_TARGET_LOCAL_NED.type_mask: what to ignore (FORCE: how to read the acceleration)."""

    POSITION = 0x007
    VELOCITY = 0x038
    ACCELERATION = 0x1C0
    FORCE = 0x200
    YAW = 0x400
    YAW_RATE = 0x800


BODY_RATES = AttitudeMask.ATTITUDE  # type_mask of a body rate and thrust set-point
POSITION_YAW = PositionMask.VELOCITY | PositionMask.ACCELERATION | PositionMask.YAW_RATE  # position and yaw only
FRAME_LOCAL_NED, FRAME_BODY_NED, FRAME_BODY_FRD, FRAME_LOCAL_FRD = 1, 8, 12, 20
ESTIMATOR_VISION, ESTIMATOR_VIO, ESTIMATOR_AUTOPILOT = 2, 3, 8
SET_MODE_FLAG = BaseMode.CUSTOM  # param1 of DO_SET_MODE; PX4 ignores the other bits


def custom_mode(main: int, sub: int = 0) -> int:
    """HEARTBEAT.custom_mode of a main and sub mode."""
    return (int(main) << 16) | (int(sub) << 24)


def split_custom_mode(custom: int) -> tuple[int, int]:
    """Main and sub mode of a custom_mode (unknown numbers come back as they are)."""
    return (custom >> 16) & 0xFF, (custom >> 24) & 0xFF


HOLD = custom_mode(Main.AUTO, Auto.LOITER)
TAKEOFF = custom_mode(Main.AUTO, Auto.TAKEOFF)
LAND = custom_mode(Main.AUTO, Auto.LAND)
RTL = custom_mode(Main.AUTO, Auto.RTL)
MISSION = custom_mode(Main.AUTO, Auto.MISSION)
OFFBOARD = custom_mode(Main.OFFBOARD)
ALTCTL = custom_mode(Main.ALTCTL)
POSCTL = custom_mode(Main.POSCTL)
ORBIT = custom_mode(Main.POSCTL, 1)


@lru_cache(maxsize=64)
def mode_name(custom: int) -> str:
    """Readable mode, as in "OFFBOARD" or "AUTO.LOITER"; unknown modes show their numbers."""
    main, sub = split_custom_mode(custom)
    try:
        name = Main(main).name
    except ValueError:
        return f"UNKNOWN({main}.{sub})"
    if main != Main.AUTO:
        return "ORBIT" if custom == ORBIT else name
    try:
        return f"AUTO.{Auto(sub).name}"
    except ValueError:
        return f"AUTO.{sub}"


def counts_as_rates(type_mask: int) -> bool:
    """True if this SET_ATTITUDE_TARGET mask makes a rate set-point: attitude ignored, roll and pitch rate given."""
    ignored = type_mask & (AttitudeMask.ROLL_RATE | AttitudeMask.PITCH_RATE | AttitudeMask.ATTITUDE)
    return ignored == AttitudeMask.ATTITUDE


def counts_as_attitude(type_mask: int) -> bool:
    """True if a SET_ATTITUDE_TARGET with this mask is an attitude set-point; its rates are then overridden by PX4."""
    return not type_mask & AttitudeMask.ATTITUDE


def counts_as_position(type_mask: int) -> bool:
    """True if a SET_POSITION_TARGET_LOCAL_NED with this mask gives any of position, velocity or acceleration."""
    fields = (PositionMask.POSITION, PositionMask.VELOCITY, PositionMask.ACCELERATION)
    return any(type_mask & field != field for field in fields)
