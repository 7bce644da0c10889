"""The PX4 driver's phases on the ground: connect, parameters, streams, ready, verify, arm."""

from __future__ import annotations

from collections.abc import Callable

from kernel.rotations import yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import Frame
from vehicle.px4.driver.arming import Arming, Identity
from vehicle.px4.driver.core import BEFORE_FLIGHT, SECOND, LinkCore
from vehicle.px4.driver.send import ByteWire
from vehicle.px4.driver.types import LinkConfig

ARM = int(px4.Command.COMPONENT_ARM_DISARM)
SETPOINT_NS = 50_000_000  # between position set-points
_INTERVAL = int(px4.Command.SET_MESSAGE_INTERVAL)


class GroundPhases(LinkCore):
    """Each `_step_` does the work of its phase and enters the next one."""

    def __init__(self, wire: ByteWire, config: LinkConfig, listen: Callable[[Frame], None] | None = None) -> None:
        super().__init__(wire, config, listen)
        self._streams: list[tuple[int, float]] = []
        self._reading = True
        self._arming: Arming | None = None  # what has to be verified before it arms
        self._ground_z = 0.0
        self._setpoint_ns = -SECOND
        self._ours = False  # this driver armed it and may land it

    def allow_arming(self, arming: Arming) -> None:
        """Where the configuration has `arm = False`, the driver arms and takes off only after this call.

        It asks the autopilot anew, just before, which one it is and what it holds, and arms only what `arming`
        describes. No effect where the driver arms by itself.
        """
        if not self._config.arm:
            self._arming = arming

    def refuse_arming(self) -> None:
        """Give up while waiting for `allow_arming`: phase failed."""
        if self.phase in BEFORE_FLIGHT:
            self._enter("failed")

    def _step_connect(self, now_ns: int) -> None:
        autopilot = self._autopilot
        if autopilot.heartbeat_ns is None:
            if self._elapsed(10.0):
                self._since = self._t
                others = ", ".join(f"{system}/{component}" for system, component in sorted(autopilot.other_senders))
                wanted = f"system {self._config.system}, component {self._config.component}"
                refused = self.counters["unsigned_frames"]
                unsigned = f"; {refused} frames without a valid signature were refused" if refused else ""
                self._note("warning", f"no PX4 received as {wanted} yet (received: {others or 'nothing'}){unsigned}")
        elif autopilot.armed:
            self._fail("the vehicle is already armed. Land and disarm it first")
        else:
            self._reading = True
            self._enter("parameters")

    def _step_parameters(self, now_ns: int) -> None:
        check = self._autopilot.parameters
        if self._reading and not check.unread:
            self._reading = False
            self._enter("parameters")  # a new request, with its own tries
        if check.done:
            self._notes += check.report()
            self._streams = list(self._config.streams.items())
            self._enter("streams")
        elif self._ask(""):
            for name, payload in check.requests():
                self._send.payload(name, payload)
        elif self._tries >= self._config.tries and self._late():
            reason = check.give_up_reading() if self._reading else ""
            if reason or not self._reading:
                self._fail(reason or f"{', '.join(check.unset)} was not accepted: PX4 refuses the value")

    def _step_streams(self, now_ns: int) -> None:
        if self._asked is not None and self._new_ack(_INTERVAL) is not None:
            number, hz = self._streams.pop(0)
            if hz and self._autopilot.acks[_INTERVAL][0] != px4.Result.ACCEPTED:
                self._note("warning", f"the autopilot refuses {hz:g} Hz for message {number}")
            self._tries, self._asked = 0, None
        if not self._streams:
            self._enter("ready")
        elif self._ask(f"the interval of message {self._streams[0][0]} was not answered", _INTERVAL):
            self._send.interval(*self._streams[0])

    def _step_ready(self, now_ns: int) -> None:
        autopilot = self._autopilot
        self._stream_here(now_ns)
        if autopilot.prearm and autopilot.odometry is not None and autopilot.mode == px4.OFFBOARD:
            self._since = self._t  # it is ready; arming may be allowed at any time
            if self._arming is not None:
                autopilot.identity = None
                autopilot.parameters.read_again(self._arming.parameters)
                self._enter("verify")
            elif self._config.arm:
                self._enter("arm")
        elif self._elapsed(self._config.prearm_limit):
            what = "its pre-arm checks did not pass"
            if autopilot.odometry is None:
                what = "no usable ODOMETRY came"
            elif autopilot.mode != px4.OFFBOARD:
                what = "OFFBOARD was refused"
            self._fail(f"the autopilot is not ready after {self._config.prearm_limit:g} s: {what}")
        elif autopilot.odometry is not None and autopilot.mode != px4.OFFBOARD and self._late():
            self._asked = self._t
            self._send.mode(px4.OFFBOARD)

    def _step_verify(self, now_ns: int) -> None:
        autopilot, arming = self._autopilot, self._arming or Arming()
        check = autopilot.parameters
        self._stream_here(now_ns)
        complete = autopilot.identity is not None and not check.unread
        if complete or (self._tries >= self._config.tries and self._late()):
            identity = autopilot.identity or Identity()
            held = {name: value for name, value in check.values.items() if name not in check.unread}
            faults = arming.faults(identity, held)
            if faults:
                self._fail(f"not armed, this is not as it was checked: {'; '.join(faults)}")
            else:
                self._note("info", f"autopilot {identity.text}")
                self._enter("arm")
        elif self._ask(""):
            if autopilot.identity is None:
                self.ask_identity()
            for name in check.unread:
                self.ask_parameter(name)

    def _step_arm(self, now_ns: int) -> None:
        autopilot = self._autopilot
        self._stream_here(now_ns)
        if self._asked is not None and self._new_ack(ARM) == px4.Result.ACCEPTED:
            autopilot.arming_answered(True, now_ns)
        if autopilot.armed and autopilot.odometry is not None:
            self._ours = True
            self._ground_z = autopilot.odometry.position[2]
            self._enter("takeoff")
        elif self._ask(f"arming was refused ({self._result_name(ARM)})", ARM):
            self._send.arm()

    def _stream_here(self, now_ns: int) -> None:
        """Position set-points at the vehicle's position. It arms and climbs in OFFBOARD: PX4 lands it if the set-points
        stop at any moment from arming on, while a take-off in AUTO would end in a hover without end."""
        odometry = self._autopilot.odometry
        if odometry is not None and now_ns - self._setpoint_ns >= SETPOINT_NS:
            self._setpoint_ns = now_ns
            self._send.position(odometry.position, (0.0, 0.0, 0.0), yaw(odometry.orientation))
