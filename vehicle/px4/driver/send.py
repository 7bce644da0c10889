"""Every message the driver sends, from world ENU and body FLU into PX4's NED and FRD."""

from __future__ import annotations

import math
from typing import Protocol

from kernel.rotations import swap_attitude, swap_body, swap_world, swap_yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES, MessageType, Packer
from vehicle.px4.driver.signing import Signer
from vehicle.px4.driver.types import ExternalPose, LinkConfig, Rates, Vec3

OUR_SYSTEM, OUR_COMPONENT = 245, 190  # ids of a ground station, as MAVSDK uses them
GRAVITY = 9.80665
_NAN = math.nan
_IDENTITY = (1.0, 0.0, 0.0, 0.0)
_POSITION_VELOCITY_YAW = int(px4.PositionMask.ACCELERATION | px4.PositionMask.YAW_RATE)  # fields that PX4 ignores
_VELOCITY = int(px4.PositionMask.POSITION | px4.PositionMask.ACCELERATION | px4.PositionMask.YAW)
_NO_COVARIANCE = (_NAN,) * 21
_TYPE_ONBOARD, _AUTOPILOT_NONE, _ACTIVE, _VERSION = 18, 8, 4, 3


class ByteWire(Protocol):
    """What carries MAVLink; `receive` never blocks."""

    def send(self, data: bytes, /) -> object: ...

    def receive(self) -> list[bytes]: ...


class Sender:
    """Packs, signs if configured, and sends. `sent` counts frames."""

    def __init__(self, wire: ByteWire, config: LinkConfig) -> None:
        self._wire, self._origin, self._target = wire, config.origin, (config.system, config.component)
        self._packer = Packer(OUR_SYSTEM, OUR_COMPONENT)
        self.signer = Signer(config.signing) if config.signing else None
        self._now_ns = 0
        self.sent = 0

    def begin(self, now_ns: int) -> None:
        """The time of what is sent next."""
        self._now_ns = now_ns

    def heartbeat(self) -> None:
        """HEARTBEAT of an onboard computer."""
        self._send("HEARTBEAT", _TYPE_ONBOARD, _AUTOPILOT_NONE, 0, 0, _ACTIVE, _VERSION)

    def timesync_request(self) -> None:
        """TIMESYNC: request for PX4's time."""
        self._send("TIMESYNC", 0, self._now_ns, 0, 0)

    def timesync_answer(self, px4_ns: int, now_ns: int) -> None:
        """TIMESYNC: the answer with our time (an answer of 0 would be a request)."""
        self._send("TIMESYNC", max(1, now_ns), px4_ns, *self._target)

    def command(self, number: int, *params: float) -> None:
        """COMMAND_LONG; missing parameters are 0."""
        self._send("COMMAND_LONG", *self._target, int(number), 0, *params, *(0.0,) * (7 - len(params)))

    def arm(self) -> None:
        """Request arming."""
        self.command(px4.Command.COMPONENT_ARM_DISARM, 1.0)

    def disarm(self, force: bool) -> None:
        """Request disarming; `force` stops the motors also in the air."""
        self.command(px4.Command.COMPONENT_ARM_DISARM, 0.0, float(px4.FORCE_MAGIC) if force else 0.0)

    def mode(self, custom: int) -> None:
        """Request a mode."""
        main, sub = px4.split_custom_mode(custom)
        self.command(px4.Command.DO_SET_MODE, float(px4.SET_MODE_FLAG), float(main), float(sub))

    def interval(self, message: int, hz: float) -> None:
        """Request a message at `hz`; 0 stops it."""
        self.command(px4.Command.SET_MESSAGE_INTERVAL, float(message), 1e6 / hz if hz else -1.0)

    def payload(self, name: str, payload: bytes) -> None:
        """A message whose payload is already as on the wire."""
        self._frame(MESSAGES[name], payload)

    def position(self, position: Vec3, velocity: Vec3, heading: float) -> None:
        """Position set-point with velocity feed-forward: m, m/s and rad (counter-clockwise from east), world."""
        x, y, z = (here - zero for here, zero in zip(position, self._origin, strict=True))
        self._send(
            "SET_POSITION_TARGET_LOCAL_NED", self._boot_ms(), *self._target, px4.FRAME_LOCAL_NED,
            _POSITION_VELOCITY_YAW, *swap_world(x, y, z), *swap_world(*velocity), 0.0, 0.0, 0.0, swap_yaw(heading), 0.0,
        )  # fmt: skip

    def stop(self) -> None:
        """Velocity set-point of 0, the heading as it is."""
        self._send(
            "SET_POSITION_TARGET_LOCAL_NED", self._boot_ms(), *self._target, px4.FRAME_LOCAL_NED, _VELOCITY,
            *(0.0,) * 11,
        )  # fmt: skip

    def rates(self, command: Rates, hover_thrust: float) -> float:
        """Body rates and thrust; returns the normalised thrust (0..1) on the wire."""
        thrust = min(1.0, max(0.0, command.thrust / GRAVITY * hover_thrust))
        self._send(
            "SET_ATTITUDE_TARGET", self._boot_ms(), *self._target, int(px4.BODY_RATES), _IDENTITY,
            *swap_body(*command.body_rate), thrust, (0.0, 0.0, 0.0),
        )  # fmt: skip
        return thrust

    def external_pose(self, pose: ExternalPose) -> None:
        """ODOMETRY for PX4's estimator, stamped on our clock, which PX4 converts by our TIMESYNC answers."""
        x, y, z = (here - zero for here, zero in zip(pose.position, self._origin, strict=True))
        self._send(
            "ODOMETRY", max(0, pose.stamp_ns) // 1000, px4.FRAME_LOCAL_NED, px4.FRAME_BODY_FRD, *swap_world(x, y, z),
            swap_attitude(pose.orientation), _NAN, _NAN, _NAN, _NAN, _NAN, _NAN, _NO_COVARIANCE, _NO_COVARIANCE, 0,
            px4.ESTIMATOR_VIO, 0,
        )  # fmt: skip

    def _boot_ms(self) -> int:
        return (self._now_ns // 1_000_000) & 0xFFFFFFFF

    def _send(self, name: str, *values: object) -> None:
        message = MESSAGES[name]
        self._frame(message, message.payload(values))

    def _frame(self, message: MessageType, payload: bytes) -> None:
        frame = self._packer.pack_payload(message, payload)
        if self.signer is not None:
            frame = self.signer.sign(frame, message.crc_extra, self._now_ns)
        self.sent += 1
        self._wire.send(frame)
