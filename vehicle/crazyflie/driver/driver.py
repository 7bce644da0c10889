"""The driver of a Crazyflie, real or simulated, on any CRTP wire: from the first packet to body rates and back.

`step` never blocks and reads no clock. It takes the vehicle through the phases of `LinkOutput.phase`, as the PX4 driver
does. The firmware levels a vehicle whose set-points stop and, 2 s later, stops its motors in the air: where only the
commands stop, or its battery stays low, this driver therefore lands it with the high-level commander.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from vehicle.crazyflie import commands
from vehicle.crazyflie.commands import FULL_WORD, GoTo, Vertical
from vehicle.crazyflie.crtp import Info, SupervisorCommand
from vehicle.crazyflie.driver.core import LOW_POWER, SECOND, ByteWire
from vehicle.crazyflie.driver.prepare import GroundPhases
from vehicle.crazyflie.driver.types import CrazyflieConfig
from vehicle.crazyflie.thrust import available_force, word_of
from vehicle.px4.driver.goto import Approach, HoverThrust
from vehicle.px4.driver.types import ExternalPose, LinkOutput, Rates
from vehicle.quadrotor.airframe import GRAVITY

_CLIMB_M, _CLIMB_S = 0.8, 2.0  # the take-off: height above the ground, duration
_PEAK = 35.0 / 16.0  # greatest over mean speed of the high-level commander's polynomials
_LANDING_SPEED = 0.5  # m/s, mean
_KILL_NS = 40_000_000
_LOW_NS = 1_500_000_000  # a battery that is low for so long does not recover; a moment of full thrust is shorter
_IN_FLIGHT = ("takeoff", "goto", "hover", "handed_over")


class CrazyflieLink(GroundPhases):
    """One Crazyflie on one wire."""

    def __init__(self, wire: ByteWire, config: CrazyflieConfig) -> None:
        super().__init__(wire, config)
        expected = word_of(0.25 * config.mass * GRAVITY) / FULL_WORD
        self._approach = Approach(config)
        self._learned = HoverThrust(expected, config.hover_thrust_tolerance)
        self.hover_thrust = expected  # share of the full word that is sent for one g
        self._command_ns = self._low_ns = 0
        self._landing_s = 0.0
        self._killing = False
        phases = ("connect", "parameters", "streams", "ready", "verify", "arm")
        flight = ("takeoff", "goto", "hover", "handed_over", "released", "failed")
        self._steps: dict[str, Callable[[], None]] = {
            name: getattr(self, f"_step_{name}") for name in (*phases, *flight)
        }

    def kill(self) -> None:
        """Stop the motors at once, in the air or perched; repeated until it reports that it is disarmed."""
        self._killing = True

    def release(self) -> None:
        """Hand the vehicle back: its high-level commander lands it where it is. No effect on the ground."""
        if self.phase in _IN_FLIGHT:
            self._enter("released")

    def step(self, now_ns: int, command: Rates | None = None, external_pose: ExternalPose | None = None) -> LinkOutput:
        """Process received packets, advance the phase, send what is due. Call it at 100 Hz or faster.

        `command` takes control over once hovering, and must then come every `gap_limit`. `external_pose` is passed on
        to its estimator, at most at `external_pose_hz`.
        """
        self._notes = []
        self._receive(now_ns)
        self._pass_on(external_pose)
        sent = None
        if self._killing:
            self._step_killed()
        else:
            if command is not None:
                sent = self._take(command)
            if sent is None:
                self._steps[self.phase]()
        return self._output(now_ns, sent, self._learned.value)

    def _take(self, command: Rates) -> float | None:
        """Send a command if the phase allows it; returns the share of the full thrust word, or None."""
        finite = all(map(math.isfinite, (*command.body_rate, command.thrust)))
        if finite and self.phase in ("hover", "handed_over"):
            self._check_control()
        if not finite or self.phase not in ("hover", "handed_over"):
            self.refused += 1
            return None
        if self.phase == "hover":
            self.hover_thrust = self._learned.value
            self._enter("handed_over")
        self._command_ns = self._now
        status = self._device.status
        most = word_of(available_force(status.battery_v)) if status is not None else FULL_WORD
        word = min(most, max(0, round(command.thrust / GRAVITY * self.hover_thrust * FULL_WORD)))
        self._send(commands.rates(commands.Rates(command.body_rate, word)))
        return word / FULL_WORD

    # phases

    def _step_takeoff(self) -> None:
        odometry = self._device.odometry
        if odometry is None:
            return
        height = odometry.position[2] - self._ground_z
        if not self._may_fly():
            self._fail(f"it can no longer fly before it took off: {self._mode()}")
        elif self.in_air and height > 0.7 * _CLIMB_M and self._elapsed(_CLIMB_S):
            self._low_ns = self._now
            self._approach.begin(odometry.position, odometry.velocity)
            self._enter("goto")
            self._go_to_start()
        elif self._elapsed(15.0):
            self._fail(f"the vehicle is only {height:.1f} m up, 15 s after arming")
        elif not self.in_air and self._ask(""):
            self._send(commands.vertical(Vertical(False, self._ground_z + _CLIMB_M, None, _CLIMB_S)))

    def _go_to_start(self) -> None:
        odometry, config = self._device.odometry, self._config
        assert odometry is not None
        away = math.dist(odometry.position, config.start[:3])
        duration = max(2.0, _PEAK * away / config.goto_speed)
        self._send(commands.go_to(GoTo(False, config.start[:3], config.start[3], duration)))
        self._landing_s = duration  # of this flight: it is sent anew only after it

    def _step_goto(self) -> None:
        odometry, config = self._device.odometry, self._config
        self._check_control()
        if self.phase != "goto" or odometry is None:
            return
        away = math.dist(odometry.position, config.start[:3])
        if self._settled() and self._learned.known:
            self._arrive()
        elif self._elapsed(config.goto_limit):
            self._fail(f"not at rest at the start after {config.goto_limit:g} s: {away:.2f} m away")
        elif self._elapsed(self._landing_s + 3.0) and away > 0.3 and self._ask(""):
            self._go_to_start()

    def _arrive(self) -> None:
        complaint = self._learned.complaint()
        if complaint:
            self._fail(complaint)
            return
        self._note("info", f"hover thrust {self._learned.value:.3f}, expected {self.hover_thrust:.3f}")
        self._enter("hover")

    def _step_hover(self) -> None:
        self._check_control()
        self._settled()

    def _step_handed_over(self) -> None:
        """Without a command nothing is sent."""
        self._check_control()

    def _step_released(self) -> None:
        """Land; once down, disarm."""
        odometry, status = self._device.odometry, self._device.status
        if odometry is None or status is None or not self.armed:
            return
        if self._tries == 0:
            self._asked = None
            height = max(0.0, odometry.position[2] - self._ground_z)
            self._landing_s = max(1.5, height / _LANDING_SPEED)
        active = status.has(Info.HIGH_LEVEL_ACTIVE)
        if self._elapsed(self._landing_s + 0.5) and not active:
            if self._ask(""):
                self._send(commands.supervisor(SupervisorCommand.ARM, 0))
        elif (self._tries == 0 or not active) and self._ask(""):
            # The landing first: a commander without a plan would stop the motors once the set-points have ended.
            self._send(commands.vertical(Vertical(True, self._ground_z, None, self._landing_s)))
            self._send(commands.relax())

    def _step_failed(self) -> None:
        if self._ours:
            self._step_released()

    def _step_killed(self) -> None:
        if self.phase != "killed":
            self._enter("killed")
        if self._asked is None or (self.armed and self._now - self._asked >= _KILL_NS):
            self._asked = self._now
            self._send(commands.stop())
            self._send(commands.supervisor(SupervisorCommand.ARM, 0))

    # shared by the phases

    def _may_fly(self) -> bool:
        status = self._device.status
        return status is not None and status.has(Info.CAN_FLY)

    def _check_control(self) -> None:
        """Land if commands have stopped or the battery stays low; nothing can be done for a vehicle whose supervisor
        lets it fly no more."""
        silent, status = self._now - self._command_ns, self._device.status
        if status is None or status.power != LOW_POWER:
            self._low_ns = self._now
        if not self._may_fly():
            self._fail(f"control lost: {self._mode()}")
        elif self.phase == "handed_over" and silent > self._config.gap_limit * SECOND:
            self._note("error", f"control lost: no command for {silent / 1e9:.2f} s; it lands")
            self._enter("released")
        elif self._now - self._low_ns > _LOW_NS:
            self._note("error", f"its battery is low for {_LOW_NS / 1e9:g} s; it lands")
            self._enter("released")

    def _settled(self) -> bool:
        """Judge the hover and learn the hover thrust from it."""
        settled = self._approach.settled(self._now, self._device.odometry)
        if self._approach.at_rest:
            self._learned.add([word / FULL_WORD for word in self._device.words])
        self._device.words.clear()
        return settled
