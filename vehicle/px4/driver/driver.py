"""The driver of a PX4 autopilot, real or simulated, on any byte wire: from the first HEARTBEAT to body rates and back.

`step` never blocks and reads no clock. It takes the vehicle through the phases of `LinkOutput.phase`; PX4's mode is
taken from CURRENT_MODE and HEARTBEAT only, because the first COMMAND_ACK of a mode change is always ACCEPTED. After
the hand-over rates are sent only while commands come; after a gap the vehicle brakes and the autopilot lands it. PX4
would return to OFFBOARD when a stream resumes; after a change of mode this driver therefore sends none.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from kernel.rotations import yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import Frame
from vehicle.px4.driver.braking import BRAKE_NS, braking_rates
from vehicle.px4.driver.core import BEFORE_FLIGHT, SECOND
from vehicle.px4.driver.goto import Approach, HoverThrust
from vehicle.px4.driver.prepare import ARM, SETPOINT_NS, GroundPhases
from vehicle.px4.driver.send import ByteWire
from vehicle.px4.driver.types import ExternalPose, LinkConfig, LinkOutput, Rates

_KILL_NS = 100_000_000
_TAKEN_OFF_M, _CLIMB_M = 1.0, 1.5  # above the ground: from here it flies to the start; the take-off's set-point
_BRAKE_ABOVE, _BRAKED = 1.0, 0.5  # m/s: a faster vehicle brakes before it is handed back, down to the second
_BRAKE_LIMIT_S = 1.5
_OURS = (px4.OFFBOARD, px4.LAND, px4.RTL)  # modes that this driver, or a failsafe in its flight, has brought about
_IN_FLIGHT = ("takeoff", "goto", "hover", "handed_over", "interrupted")


class Px4Link(GroundPhases):
    """One autopilot on one wire."""

    def __init__(self, wire: ByteWire, config: LinkConfig, listen: Callable[[Frame], None] | None = None) -> None:
        super().__init__(wire, config, listen)
        self._approach = Approach(config)
        self._learned = HoverThrust(config.hover_thrust, config.hover_thrust_tolerance)
        self.hover_thrust = config.hover_thrust  # the normalised thrust that is sent for one g
        self._command_t = self._setpoint_t = 0
        self._killing = False  # a kill was requested
        self._climb_from: tuple[float, float, float] | None = None  # x, y (m) and yaw (rad) on the ground
        flight = (*_IN_FLIGHT, "arm", "brake", "released", "failed")
        self._steps: dict[str, Callable[[int], None]] = {
            name: getattr(self, f"_step_{name}") for name in (*BEFORE_FLIGHT, *flight)
        }

    def kill(self) -> None:
        """Stop the motors at once, in the air or perched; repeated until the autopilot reports that it is disarmed."""
        self._killing = True

    def release(self) -> None:
        """Brake, then hand the vehicle back: the autopilot lands it there and disarms. No effect on the ground."""
        if self.phase == "handed_over" and self._speed() > _BRAKE_ABOVE:
            self._enter("brake")
        elif self.phase in _IN_FLIGHT:
            self._enter("released")

    def step(self, now_ns: int, command: Rates | None = None, external_pose: ExternalPose | None = None) -> LinkOutput:
        """Process received frames, advance the phase, send what is due. Call it at 100 Hz or faster.

        `command` takes control over once hovering, and must then come every `gap_limit`. `external_pose` is passed on
        to PX4's estimator, at most at `external_pose_hz`.
        """
        self._notes = []
        self._send.begin(now_ns)
        self._receive(now_ns)
        self._routine(now_ns, external_pose)
        sent = None
        if self._killing:
            self._step_killed(now_ns)
        else:
            if command is not None:
                sent = self._take(command)
            if sent is None:
                self._steps[self.phase](now_ns)
        return self._output(now_ns, sent, self._learned.value)

    def _take(self, command: Rates) -> float | None:
        """Send a command if the phase allows it; returns the normalised thrust, or None."""
        finite = all(map(math.isfinite, (*command.body_rate, command.thrust)))
        if finite and self.phase in ("hover", "handed_over"):
            self._check_control()
        if not finite or self.phase not in ("hover", "handed_over"):
            self.refused += 1
            return None
        if self.phase == "hover":
            self.hover_thrust = self._learned.value
            self._enter("handed_over")
        self._command_t = self._t
        return self._send.rates(command, self.hover_thrust)

    def _speed(self) -> float:
        odometry = self._autopilot.odometry
        return math.hypot(*odometry.velocity) if odometry is not None else 0.0

    # phases

    def _step_takeoff(self, now_ns: int) -> None:
        """Straight up; PX4 spools the motors up and ramps the climb rate."""
        autopilot = self._autopilot
        if autopilot.odometry is None:
            return
        x, y, z = autopilot.odometry.position
        height = z - self._ground_z
        if not autopilot.armed:
            self._fail("the vehicle disarmed before it took off")
        elif autopilot.in_air and height > _TAKEN_OFF_M:
            self._approach.begin(autopilot.odometry.position, autopilot.odometry.velocity)
            self._setpoint_t, self._odometry_count = self._t, 0
            self._enter("goto")
        elif self._elapsed(20.0):
            self._fail(f"the vehicle is only {height:.1f} m up, 20 s after arming")
        else:
            self._climb_from = self._climb_from or (x, y, yaw(autopilot.odometry.orientation))
            self._stream_climb(now_ns)
            self._check_control()

    def _step_goto(self, now_ns: int) -> None:
        autopilot, config = self._autopilot, self._config
        self._stream_position(now_ns)
        self._check_control()
        if self.phase != "goto":
            return
        if self._settled() and self._learned.known:
            self._arrive()
        elif self._elapsed(config.goto_limit) and autopilot.odometry is not None:
            away = math.dist(autopilot.odometry.position, config.start[:3])
            speed = math.hypot(*autopilot.odometry.velocity)
            self._fail(f"not at rest at the start after {config.goto_limit:g} s: {away:.2f} m away, {speed:.2f} m/s")

    def _arrive(self) -> None:
        if complaint := self._learned.complaint():
            self._fail(complaint)
            return
        rate = self._odometry_count / max(1e-3, (self._t - self._since) * 1e-9)
        if rate < 0.8 * self._config.streams.get(331, 0.0):
            self._note("warning", f"ODOMETRY comes at {rate:.0f} Hz only")
        self._note("info", f"hover thrust {self._learned.value:.3f}, expected {self._config.hover_thrust:.3f}")
        self._enter("hover")

    def _step_hover(self, now_ns: int) -> None:
        self._stream_position(now_ns)
        self._check_control()
        self._settled()

    def _step_handed_over(self, now_ns: int) -> None:
        """Without a command nothing is sent."""
        self._check_control()

    def _step_brake(self, now_ns: int) -> None:
        """Stop in OFFBOARD. PX4's modes that land or hold would slow down by MPC_ACC_HOR, too late before a board."""
        self._check_control()
        if self.phase != "brake":
            return
        if self._speed() < _BRAKED or self._elapsed(_BRAKE_LIMIT_S):
            self._enter("released")
            self._step_released(now_ns)
        elif now_ns - self._setpoint_ns >= BRAKE_NS:
            self._setpoint_ns = now_ns
            rates = braking_rates(self._t, self._autopilot.odometry, self.hover_thrust)
            if rates is None:
                self._send.stop()
            else:
                self._send.rates(rates, self.hover_thrust)

    def _step_interrupted(self, now_ns: int) -> None:
        """Nothing is sent, so that the autopilot's failsafe, or the pilot who has taken over, flies."""

    def _step_released(self, now_ns: int) -> None:
        autopilot = self._autopilot
        if not autopilot.armed:
            self._rest()
        elif autopilot.mode != px4.LAND or autopilot.failsafe:  # a failsafe's landing would end when a stream resumes
            if self._ask("landing was refused"):
                self._send.mode(px4.LAND)
        elif autopilot.landed_state == px4.Landed.ON_GROUND and self._elapsed(5.0) and self._late():
            self._asked = self._t
            self._send.disarm(force=False)

    def _step_failed(self, now_ns: int) -> None:
        if not self._ours:
            return
        if not self._autopilot.armed:
            self._rest()
        elif self._autopilot.mode != px4.LAND and self._late():
            self._asked = self._t
            self._send.mode(px4.LAND)

    def _step_killed(self, now_ns: int) -> None:
        begins = self.phase != "killed"
        if begins:
            self._enter("killed")
        elif self._autopilot.armed and self._new_ack(ARM) == px4.Result.ACCEPTED:
            self._autopilot.arming_answered(False, now_ns)
            self._asked = None
        if begins or (self._autopilot.armed and (self._asked is None or self._t - self._asked >= _KILL_NS)):
            self._asked, self._acks_seen = self._t, self._autopilot.acks.get(ARM, (0, 0))[1]
            self._send.disarm(force=True)
        elif not self._autopilot.armed:
            self._rest()

    # shared by the phases

    def _rest(self) -> None:
        """Leave a disarmed autopilot in HOLD: in OFFBOARD, into which PX4 falls back, it cannot be armed again.

        A pilot's mode is left as it is."""
        if self._autopilot.mode in _OURS and self._late():
            self._asked = self._t
            self._send.mode(px4.HOLD)

    def _check_control(self) -> None:
        """Give control up for good to a failsafe or a pilot that flies it; land it if commands have stopped."""
        autopilot = self._autopilot
        silent = self._t - self._command_t
        if not autopilot.armed:
            self._interrupt("the vehicle is disarmed")
        elif autopilot.mode != px4.OFFBOARD:
            self._interrupt(f"the autopilot is in {px4.mode_name(autopilot.mode)}")
        elif self.phase == "handed_over" and silent > self._config.gap_limit * SECOND:
            self._note("error", f"control lost: no command for {silent / 1e9:.2f} s; it lands")
            self.release()

    def _interrupt(self, why: str) -> None:
        self._enter("interrupted")
        self._note("error", f"control lost: {why}; it is not taken up again")

    def _stream_climb(self, now_ns: int) -> None:
        assert self._climb_from is not None
        if now_ns - self._setpoint_ns >= SETPOINT_NS:
            self._setpoint_ns = now_ns
            x, y, heading = self._climb_from
            self._send.position((x, y, self._ground_z + _CLIMB_M), (0.0, 0.0, 0.0), heading)

    def _stream_position(self, now_ns: int) -> None:
        if now_ns - self._setpoint_ns < SETPOINT_NS:
            return
        self._setpoint_ns = now_ns
        point, velocity = self._approach.advance((self._t - self._setpoint_t) * 1e-9)
        self._setpoint_t = self._t
        self._send.position(point, velocity, self._config.start[3])

    def _settled(self) -> bool:
        """Judge the hover and learn the hover thrust from it."""
        settled = self._approach.settled(self._t, self._autopilot.odometry)
        if self._approach.at_rest:
            self._learned.add(self._autopilot.thrusts)
        self._autopilot.thrusts.clear()
        return settled
