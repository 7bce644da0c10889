"""What goes into and comes out of the PX4 driver: plain data, world ENU, body FLU, SI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from vehicle.px4.event_texts import EventTexts

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

# Message id: Hz asked of PX4; 0 stops messages that are not read here. Others stay at PX4's default.
STREAMS: Mapping[int, float] = {
    331: 100.0,  # ODOMETRY
    436: 50.0,  # CURRENT_MODE: the quick report of modes, as HEARTBEAT's rate cannot be changed
    83: 20.0,  # ATTITUDE_TARGET: the thrust of the hover
    111: 10.0,  # TIMESYNC
    1: 5.0,  # SYS_STATUS
    245: 5.0,  # EXTENDED_SYS_STATE: a MAVSDK client on the same link slows it down
    **dict.fromkeys((30, 31, 32, 33, 24, 29, 36, 74, 85, 87, 105, 132, 141, 241, 441, 12901, 12904), 0.0),
}


class Rates(NamedTuple):
    """A body rate set-point (rad/s, FLU) and mass-normalised collective thrust (m/s^2)."""

    body_rate: Vec3
    thrust: float


class Odometry(NamedTuple):
    """The autopilot's estimate at `stamp_ns` of our clock: m and m/s (world), wxyz (world from body), rad/s (body)."""

    stamp_ns: int
    position: Vec3
    velocity: Vec3
    orientation: Quat
    body_rate: Vec3


class ExternalPose(NamedTuple):
    """The vehicle's pose from motion capture at `stamp_ns` of our clock: m (world), wxyz (world from body)."""

    stamp_ns: int
    position: Vec3
    orientation: Quat


class Note(NamedTuple):
    """A text for the crew: severity is info, warning or error."""

    severity: str
    text: str


@dataclass(frozen=True)
class Signing:
    """MAVLink 2 signing. `epoch_ns`: Unix time (ns) at which our clock shows 0, because signatures carry the date.

    The key is 32 bytes, shared with the autopilot. With `require`, frames without a valid signature are refused.
    """

    key: bytes = field(repr=False)
    epoch_ns: int
    link_id: int = 1
    require: bool = True

    def __post_init__(self) -> None:
        if len(self.key) != 32:
            raise ValueError(f"a MAVLink signing key has 32 bytes, this one has {len(self.key)}")
        if not any(self.key):
            raise ValueError("a MAVLink signing key of zeros only is not secret: make a random one")


@dataclass(frozen=True)
class LinkConfig:
    """How one flight begins and what the driver requires. Times are seconds of PX4's time.

    `start`: x, y, z (m) and yaw (rad, counter-clockwise from east) of the hover, world. `origin`: where PX4's local
    frame has its origin in the world. `hover_thrust`: from the airframe file, 0..1. `parameters` are set and
    read back before arming. `fixed_offset_ns`: PX4's time less ours where it is known (a simulator in lockstep), else
    None and TIMESYNC measures it; `clock_drift`: their relative drift (1e-4 for crystals; a SITL that lags behind
    wall time needs 0.03). The hover's limits are for a vehicle on motion capture: on GPS alone it moves more
    (0.5 m, 0.5 m/s, 0.4 rad/s). Raises ValueError for numbers out of range.
    """

    start: tuple[float, float, float, float]
    origin: Vec3 = (0.0, 0.0, 0.0)
    hover_thrust: float = 0.5
    system: int = 1  # MAV_SYS_ID of the autopilot
    component: int = 1  # MAV_COMP_ID of the autopilot
    arm: bool = True  # False: waits in phase ready for `Px4Link.allow_arming`
    parameters: Mapping[str, float] = field(default_factory=lambda: {"COM_OF_LOSS_T": 0.3, "COM_OBL_RC_ACT": 4})
    required: tuple[str, ...] = ("COM_OF_LOSS_T", "COM_OBL_RC_ACT")  # an autopilot without these is not armed
    streams: Mapping[int, float] = field(default_factory=lambda: dict(STREAMS))
    goto_speed: float = 1.5  # m/s, of the set-point on its way to the start
    goto_acceleration: float = 1.0  # m/s^2, of the same
    hover_position: float = 0.15  # m
    hover_speed: float = 0.08  # m/s
    hover_turning: float = 0.15  # rad/s
    hover_time: float = 1.0  # within all three before the hover is reached
    goto_limit: float = 60.0  # to reach the start and come to rest
    hover_thrust_tolerance: float = 0.35  # relative, of the learned hover thrust against the airframe's
    prearm_limit: float = 60.0  # for the autopilot's pre-arm checks
    gap_limit: float = 0.25  # without a command after the hand-over: it brakes and lands
    answer_limit: float = 0.6  # before a request is repeated
    tries: int = 8
    external_pose_hz: float = 50.0
    steepest: float = math.radians(70.0)  # rad, attitude at the end of a perch; PX4's failure detector is judged by it
    external_vision: bool = False  # PX4 has external poses and nothing else: its parameters are judged for that
    fixed_offset_ns: int | None = None
    clock_drift: float = 1e-4
    signing: Signing | None = None
    events: EventTexts | None = None  # what the firmware's EVENTs say

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.start, *self.origin))):
            raise ValueError(f"start {self.start} and origin {self.origin} must be finite")
        if not 0.05 < self.hover_thrust < 0.95:
            raise ValueError(f"hover thrust {self.hover_thrust} of the airframe: it must lie between 0.05 and 0.95")
        if not 0.0 <= self.steepest <= math.pi / 2:
            raise ValueError(f"steepest attitude {self.steepest} rad: it must lie between 0 and pi/2")
        if not 1 <= self.system <= 255:
            raise ValueError(f"MAVLink system {self.system}: 1 to 255 (PX4 instance i is system 1 + i)")
        if not 1 <= self.component <= 255:
            raise ValueError(f"MAVLink component {self.component}: 1 to 255 (PX4 is component 1)")
        positive = ("goto_speed", "goto_acceleration", "hover_position", "hover_speed", "gap_limit", "answer_limit")
        for name in positive:
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}: it must be positive")


@dataclass
class LinkOutput:
    """What one step of the driver found.

    `phase`: connect, parameters, streams, ready, verify, arm, takeoff, goto, hover (waits for the first command),
    handed_over, brake (before it is released), interrupted (control was lost and is not resumed), released (landing),
    killed, failed.
    """

    phase: str
    connected: bool
    armed: bool
    landed: bool
    failsafe: bool
    mode: str
    battery_v: float
    hover_thrust: float  # learned; 0 while unknown
    odometry: list[Odometry] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    sent_thrust: float | None = None  # normalised 0..1, if a rate set-point went out in this step
    clock_offset_ns: int | None = None  # PX4's time less ours, by TIMESYNC; None before its first answer
