"""The driver's record of its autopilot: mode, arming, health, texts, and odometry on the driver's clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from kernel.rotations import rotate, swap_attitude, swap_body, swap_world
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES, Frame
from vehicle.px4.driver.arming import Identity, identity_of
from vehicle.px4.driver.clocks import ClockOffset, LinkTime
from vehicle.px4.driver.params import ParameterCheck
from vehicle.px4.driver.resets import Reset, reset_between
from vehicle.px4.driver.texts import Texts
from vehicle.px4.driver.types import LinkConfig, Odometry

_SECOND = 1_000_000_000
_OFFSET_ERROR_NS = 500_000_000  # of a SITL that lags; what is later than now by more is broken
_ACK_BEFORE_HEARTBEAT_NS = 500_000_000  # a HEARTBEAT may carry the state from before an ACK for that long


class Autopilot:
    """Takes frames; the driver reads its attributes. Only frames of one system and component are used.

    PX4 forwards other clients' HEARTBEATs, and sends a few commands of its own; such frames are counted in `foreign`.
    """

    def __init__(self, config: LinkConfig, answer_timesync: Callable[[int, int], None]) -> None:
        """`answer_timesync` (PX4 ns, our ns) sends the answer to PX4's own TIMESYNC."""
        self._config, self._answer_timesync = config, answer_timesync
        self.clock = ClockOffset(config.clock_drift, config.fixed_offset_ns)
        self.time = LinkTime()
        self.texts = Texts(config.events)
        self.parameters = ParameterCheck(config)
        self.heartbeat_ns: int | None = None  # our clock
        self.mode = 0  # custom_mode
        self.armed = self.prearm = self.failsafe = False
        self.landed_state = int(px4.Landed.UNDEFINED)
        self.battery_v = 0.0
        self.odometry: Odometry | None = None
        self.fresh: list[Odometry] = []
        self.resets: list[Reset | None] = []  # of the estimate, while armed, since the step's begin
        self.identity: Identity | None = None  # as last told
        self.thrusts: list[float] = []  # of ATTITUDE_TARGET, since last cleared
        self.acks: dict[int, tuple[int, int]] = {}  # command: (result, how many so far)
        self.foreign = self.bad_odometry = 0
        self.other_senders: set[tuple[int, int]] = set()
        self.rebooted = False
        self._armed_by_ack_ns = -_SECOND
        self._reset_counter: int | None = None
        handlers: dict[str, Callable[[Any, int], None]] = {
            "HEARTBEAT": self._heartbeat,
            "CURRENT_MODE": self._current_mode,
            "SYS_STATUS": self._sys_status,
            "EXTENDED_SYS_STATE": self._extended_sys_state,
            "TIMESYNC": self._timesync,
            "ATTITUDE_TARGET": self._attitude_target,
            "COMMAND_ACK": self._command_ack,
            "STATUSTEXT": self.texts.receive,
            "EVENT": self.texts.event,
            "ODOMETRY": self._odometry,
            "AUTOPILOT_VERSION": self._version,
        }
        self._handlers = {MESSAGES[name].id: handler for name, handler in handlers.items()}
        self._param_value = MESSAGES["PARAM_VALUE"].id

    def begin(self) -> None:
        """A new step: clear what was new in the last one."""
        self.fresh, self.resets, self.rebooted = [], [], False

    def frame(self, frame: Frame, now_ns: int) -> bool:
        """One frame from the wire; False if it is of another sender."""
        if frame.system != self._config.system or frame.component != self._config.component:
            self.foreign += 1
            if len(self.other_senders) < 16:
                self.other_senders.add((frame.system, frame.component))
            return False
        handler = self._handlers.get(frame.id)
        if frame.id == self._param_value:
            self.parameters.receive(frame.payload)
        elif handler is not None:
            handler(frame.fields, now_ns)
        return True

    def connected(self, now_ns: int) -> bool:
        """True while HEARTBEATs come."""
        return self.heartbeat_ns is not None and now_ns - self.heartbeat_ns < 3 * _SECOND

    @property
    def in_air(self) -> bool:
        """By EXTENDED_SYS_STATE; False while unknown."""
        return self.landed_state in (px4.Landed.IN_AIR, px4.Landed.TAKEOFF, px4.Landed.LANDING)

    def _heartbeat(self, f: Any, now_ns: int) -> None:
        if f.autopilot != px4.AUTOPILOT_PX4:
            return
        self.heartbeat_ns = now_ns
        self.mode = f.custom_mode
        self.failsafe = f.system_status in (px4.State.CRITICAL, px4.State.FLIGHT_TERMINATION)
        if now_ns - self._armed_by_ack_ns >= _ACK_BEFORE_HEARTBEAT_NS:
            self.armed = bool(f.base_mode & px4.BaseMode.ARMED)

    def _current_mode(self, f: Any, now_ns: int) -> None:
        self.mode = f.custom_mode

    def _sys_status(self, f: Any, now_ns: int) -> None:
        self.prearm = bool(f.onboard_control_sensors_health & px4.PREARM_CHECK)
        self.battery_v = f.voltage_battery / 1000.0 if f.voltage_battery != 65535 else 0.0

    def _extended_sys_state(self, f: Any, now_ns: int) -> None:
        self.landed_state = f.landed_state

    def _timesync(self, f: Any, now_ns: int) -> None:
        if f.tc1 == 0:
            self._stamp(f.ts1)
            self._answer_timesync(f.ts1, now_ns)
        else:  # the target fields of PX4's answer are not set; the round trip shows whether ts1 is ours
            self._stamp(f.tc1)
            self.clock.add(f.ts1, f.tc1, now_ns)

    def _stamp(self, px4_ns: int) -> None:
        if self.time.receive(px4_ns):
            self.clock.forget()
            self.odometry = self.identity = None
            self.rebooted = True

    def _attitude_target(self, f: Any, now_ns: int) -> None:
        if math.isfinite(f.thrust):
            self.thrusts.append(f.thrust)

    def _command_ack(self, f: Any, now_ns: int) -> None:
        self.acks[f.command] = (f.result, self.acks.get(f.command, (0, 0))[1] + 1)

    def arming_answered(self, armed: bool, now_ns: int) -> None:
        """The ACK of an arm or disarm command is PX4's own result, up to a second before the HEARTBEAT shows it."""
        self.armed, self._armed_by_ack_ns = armed, now_ns

    def _version(self, f: Any, now_ns: int) -> None:
        self.identity = identity_of(f)

    def _odometry(self, f: Any, now_ns: int) -> None:
        px4_ns = f.time_usec * 1000
        self._stamp(px4_ns)
        stamp = self.clock.ours(px4_ns)
        if stamp is None:
            return
        later_ns = stamp - now_ns
        stamp = min(stamp, now_ns)
        numbers = (f.x, f.y, f.z, f.vx, f.vy, f.vz, *f.q, f.rollspeed, f.pitchspeed, f.yawspeed)
        usable = all(map(math.isfinite, numbers)) and 0.9 < math.hypot(*f.q) < 1.1
        usable = usable and later_ns < _OFFSET_ERROR_NS
        if not usable or (self.odometry is not None and stamp <= self.odometry.stamp_ns):
            self.bad_odometry += 1
            return
        attitude = swap_attitude(f.q)
        velocity = swap_world(f.vx, f.vy, f.vz)  # PX4 gives LOCAL_NED as its frame
        if f.child_frame_id == px4.FRAME_BODY_FRD:
            velocity = rotate(attitude, *swap_body(f.vx, f.vy, f.vz))
        ox, oy, oz = self._config.origin
        x, y, z = swap_world(f.x, f.y, f.z)
        turning = swap_body(f.rollspeed, f.pitchspeed, f.yawspeed)
        before, self.odometry = self.odometry, Odometry(stamp, (x + ox, y + oy, z + oz), velocity, attitude, turning)
        self.fresh.append(self.odometry)
        if self.armed and f.reset_counter != self._reset_counter is not None:
            self.resets.append(None if before is None else reset_between(before, self.odometry))
        self._reset_counter = f.reset_counter
