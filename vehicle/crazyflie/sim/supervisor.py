"""The firmware's supervisor: states, arming, watchdogs, tumble check, emergency stop.

States, conditions and times are those of Bitcraze's firmware of protocol version 12 (supervisor_state_machine.c,
supervisor.c, platform_defaults.h). It decides 25 times a second.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum

from vehicle.crazyflie.crtp import Info

PERIOD_NS = 40_000_000
WATCHDOG_LEVEL_NS, WATCHDOG_STOP_NS = 500_000_000, 2_000_000_000
_EMERGENCY_WATCHDOG_NS = 1_000_000_000
_FLYING_NS = 2_000_000_000  # after the last thrust it is still called flying
_TILTED, _TILTED_NS = 0.5, 1_000_000_000  # g along body z, and for how long
_UPSIDE_DOWN, _UPSIDE_DOWN_NS = -0.2, 100_000_000
_FREE_FALL = 0.1  # g, each axis


class State(IntEnum):
    """The supervisor's state."""

    NOT_READY = 1  # pre-flight checks not passed
    READY_TO_ARM = 2  # pre-flight checks passed
    ARMING = 3
    READY_TO_FLY = 4
    FLYING = 5
    LANDED = 6
    RESET = 7
    LEVEL_OUT = 8
    FREE_FALL = 9
    LOCKED = 10
    CRASHED = 11


_CAN_FLY = (State.READY_TO_FLY, State.FLYING, State.LEVEL_OUT, State.LANDED)
_MAY_BE_ARMED = (State.ARMING, *_CAN_FLY)


class Supervisor:
    """`say` gets a text for the console; the rest is asked and told by the software Crazyflie."""

    def __init__(self, auto_arm: bool, say: Callable[[str], None]) -> None:
        """`auto_arm`: a build without CONFIG_MOTORS_REQUIRE_ARMING arms itself when its checks have passed."""
        self.auto_arms, self._say = auto_arm, say
        self.state = State.NOT_READY
        self.armed = self.tumbled = self.crashed = False
        self.tumble_check = True
        self.preflight_timeout_ns, self.landed_timeout_ns = 30_000_000_000, 3_000_000_000
        self.stop_parameter = False
        self._emergency = False
        self._emergency_watchdog_ns: int | None = None
        self._thrust_ns: int | None = None
        self._tilted_ns: int | None = None
        self._ready_ns = self._landed_ns = 0

    @property
    def can_fly(self) -> bool:
        """Whether set-points have an effect."""
        return self.state in _CAN_FLY

    @property
    def flying(self) -> bool:
        return self.state in (State.FLYING, State.LEVEL_OUT)

    @property
    def levels_out(self) -> bool:
        """Whether set-points have stopped and it flies level instead."""
        return self.state == State.LEVEL_OUT

    def request_arming(self, arm: bool) -> bool:
        """Whether it is as asked for now: it is armed only where its checks have passed."""
        if arm != self.armed and arm and self.state != State.READY_TO_ARM:
            return False
        self.armed = arm
        return True

    def request_recovery(self) -> bool:
        """Whether it is not, or no longer, crashed."""
        if self.crashed and self.tumbled:
            return False
        self.crashed = False
        return True

    def emergency_stop(self) -> None:
        """Motors off until a reboot."""
        self._emergency = True

    def feed_emergency_watchdog(self, now_ns: int) -> None:
        """From the first call on, a second without one is an emergency stop."""
        self._emergency_watchdog_ns = now_ns

    def info(self, high_level_active: bool, trajectory_finished: bool) -> int:
        """The bits of supervisor.info."""
        bits = {
            Info.CAN_BE_ARMED: self.state == State.READY_TO_ARM,
            Info.ARMED: self.armed,
            Info.AUTO_ARMED: self.auto_arms,
            Info.CAN_FLY: self.can_fly,
            Info.FLYING: self.flying,
            Info.TUMBLED: self.tumbled,
            Info.LOCKED: self.state == State.LOCKED,
            Info.CRASHED: self.crashed,
            Info.HIGH_LEVEL_ACTIVE: high_level_active,
            Info.TRAJECTORY_FINISHED: trajectory_finished,
        }
        return sum(1 << bit for bit, value in bits.items() if value)

    def update(self, now_ns: int, force: tuple[float, float, float], thrusting: bool, setpoint_ns: int) -> None:
        """`force`: what the accelerometer shows (g, body); `thrusting`: a motor turns; when a set-point last came."""
        if thrusting:
            self._thrust_ns = now_ns
        flying = self._thrust_ns is not None and now_ns - self._thrust_ns < _FLYING_NS
        self.tumbled = self._tumbles(now_ns, force) and self.tumble_check
        age = now_ns - setpoint_ns
        watched = self._emergency_watchdog_ns
        late = watched is not None and now_ns - watched >= _EMERGENCY_WATCHDOG_NS
        new = self._next(now_ns, flying, age, self._emergency or late or self.stop_parameter)
        if new != self.state:
            self.state = new
            self._entered(now_ns)

    def _tumbles(self, now_ns: int, force: tuple[float, float, float]) -> bool:
        if max(map(abs, force)) < _FREE_FALL or force[2] >= _TILTED:
            self._tilted_ns = None
            return False
        self._tilted_ns = now_ns if self._tilted_ns is None else self._tilted_ns
        since = now_ns - self._tilted_ns
        return since > _TILTED_NS or (force[2] < _UPSIDE_DOWN and since > _UPSIDE_DOWN_NS)

    def _next(self, now_ns: int, flying: bool, age_ns: int, stop: bool) -> State:
        """The first transition that applies, in the firmware's order."""
        state = self.state
        if state == State.FREE_FALL:
            return State.LOCKED
        if state == State.RESET:
            return State.NOT_READY
        if state == State.LOCKED:
            return state
        if state == State.CRASHED:
            return State.NOT_READY if not (self.crashed or self.tumbled) else State.LOCKED if stop else state
        if state == State.LANDED:
            if not self.armed or now_ns - self._landed_ns > self.landed_timeout_ns:
                return State.RESET
            return State.FLYING if flying else state
        if stop:
            return State.FREE_FALL
        if state == State.NOT_READY:
            return state if self.tumbled else State.READY_TO_ARM
        if state == State.READY_TO_ARM:
            return State.NOT_READY if self.tumbled else State.ARMING if self.armed else state
        if state == State.ARMING:
            return State.NOT_READY if self.tumbled or not self.armed else State.READY_TO_FLY
        if state == State.READY_TO_FLY:
            if self.tumbled or not self.armed or now_ns - self._ready_ns > self.preflight_timeout_ns:
                return State.NOT_READY
            return State.FLYING if flying else state
        return self._next_in_flight(flying, age_ns)

    def _next_in_flight(self, flying: bool, age_ns: int) -> State:
        if age_ns > WATCHDOG_STOP_NS:
            return State.FREE_FALL
        if self.state == State.LEVEL_OUT:
            if self.tumbled:
                return State.FREE_FALL
            return self.state if age_ns > WATCHDOG_LEVEL_NS else State.FLYING
        if self.tumbled:
            return State.CRASHED
        if not self.armed:
            return State.RESET
        if age_ns > WATCHDOG_LEVEL_NS:
            return State.LEVEL_OUT
        return self.state if flying else State.LANDED

    def _entered(self, now_ns: int) -> None:
        if self.state == State.READY_TO_FLY:
            self._ready_ns = now_ns
            self._say("SUP: Ready to fly\n")
        elif self.state == State.LANDED:
            self._landed_ns = now_ns
        elif self.state == State.FREE_FALL:
            self._say("SUP: free falling!\n")
        elif self.state == State.LOCKED:
            self._say("SUP: Locked, reboot required\n")
        elif self.state == State.CRASHED:
            self.crashed = True
            self._say("SUP: Crashed, recovery required\n")
        if self.state not in _MAY_BE_ARMED:
            self.armed = self.auto_arms and self.state == State.READY_TO_ARM


def in_g(force: tuple[float, float, float], gravity: float) -> tuple[float, float, float]:
    """A specific force (m/s^2) in g; a number that is not finite counts as free fall."""
    x, y, z = (value / gravity if math.isfinite(value) else 0.0 for value in force)
    return x, y, z
