"""The firmware's high-level commander: take-off, landing and flight to a place along polynomials of seventh order."""

from __future__ import annotations

import math
from typing import NamedTuple

from kernel.rotations import wrap_angle
from vehicle.crazyflie.commands import GoTo, Position, Stop, Vec3, Vertical
from vehicle.crazyflie.crtp import Errno

IDLE, FLYING, LANDING = "idle", "flying", "landing"


class Motion(NamedTuple):
    """Position, velocity, acceleration (m, s) and heading (rad), world."""

    position: Vec3
    velocity: Vec3
    acceleration: Vec3
    yaw: float


class _Axis:
    """One coordinate from (value, speed, acceleration) to rest at `goal`, without jerk at either end."""

    def __init__(self, start: tuple[float, float, float], goal: float, duration: float) -> None:
        value, speed, acceleration = start[0], start[1] * duration, start[2] * duration**2
        rest = goal - value - speed - 0.5 * acceleration
        velocity, bend = -speed - acceleration, -acceleration
        # The four upper coefficients of s in 0..1 that bring value, speed, acceleration and jerk to the goal's.
        self._c = (
            value,
            speed,
            0.5 * acceleration,
            0.0,
            35.0 * rest - 15.0 * velocity + 2.5 * bend,
            -84.0 * rest + 39.0 * velocity - 7.0 * bend,
            70.0 * rest - 34.0 * velocity + 6.5 * bend,
            -20.0 * rest + 10.0 * velocity - 2.0 * bend,
        )
        self._duration = duration

    def at(self, seconds: float) -> tuple[float, float, float]:
        """Value, speed, acceleration after `seconds`; at the goal once the time is over."""
        s = min(1.0, seconds / self._duration)
        value = speed = acceleration = 0.0
        for power in range(7, -1, -1):
            acceleration = acceleration * s + 2.0 * speed
            speed = speed * s + value
            value = value * s + self._c[power]
        if s >= 1.0:
            return value, 0.0, 0.0
        return value, speed / self._duration, acceleration / self._duration**2


class HighLevel:
    """Plans on commands; `setpoint` says where to be now. It begins where it last was, or where the vehicle is."""

    def __init__(self) -> None:
        self.state = IDLE
        self._from = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
        self._axes: tuple[_Axis, ...] = ()
        self._begin_ns = self._end_ns = 0

    def finished(self, now_ns: int) -> bool:
        return now_ns >= self._end_ns

    def stop(self) -> None:
        """Forget what is being flown."""
        self.state = IDLE

    def tell(self, position: Vec3, yaw: float) -> None:
        """Where the vehicle is, from which the next plan begins."""
        nothing = (0.0, 0.0, 0.0)
        self._from = Motion(position, nothing, nothing, yaw)

    def command(self, now_ns: int, command: Vertical | GoTo | Stop, can_fly: bool) -> int:
        """0, or an error number: busy where it may not fly, or is flying already."""
        if isinstance(command, Stop):
            self.stop()
            return 0
        if not can_fly:
            return Errno.BUSY
        numbers = (command.duration, *(command.position if isinstance(command, GoTo) else (command.height,)))
        if not all(map(math.isfinite, numbers)) or command.duration < 0.0:
            return Errno.INVALID
        start = self._from
        if isinstance(command, Vertical):
            if self.state == (LANDING if command.landing else FLYING) or (not command.landing and self.state != IDLE):
                return 1
            rest = Motion(start.position, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), start.yaw)
            goal = (start.position[0], start.position[1], command.height)
            yaw = start.yaw if command.yaw is None else command.yaw
            self._plan(now_ns, rest, goal, yaw, command.duration)
            self.state = LANDING if command.landing else FLYING
            return 0
        goal, yaw = command.position, command.yaw
        if command.relative:
            x, y, z = (a + b for a, b in zip(start.position, goal, strict=True))
            goal, yaw = (x, y, z), start.yaw + yaw
        self._plan(now_ns, start, goal, yaw, command.duration)
        self.state = FLYING
        return 0

    def _plan(self, now_ns: int, start: Motion, goal: Vec3, yaw: float, duration: float) -> None:
        duration = max(duration, 1e-3)
        axes = zip(start.position, start.velocity, start.acceleration, goal, strict=True)
        turn = start.yaw + wrap_angle(yaw - start.yaw)
        self._axes = (
            *(_Axis((p, v, a), g, duration) for p, v, a, g in axes),
            _Axis((start.yaw, 0.0, 0.0), turn, duration),
        )
        self._begin_ns, self._end_ns = now_ns, now_ns + round(duration * 1e9)

    def setpoint(self, now_ns: int, position: Vec3, yaw: float) -> tuple[Position, Vec3] | None:
        """Where to be, with the acceleration on the way (m/s^2); None: motors off.

        `position`, `yaw`: where the vehicle is, from which a plan begins while nothing is flown."""
        if self.state == LANDING and self.finished(now_ns):
            self.state = IDLE
        if self.state == IDLE:
            self.tell(position, yaw)
            return None
        x, y, z, turn = (axis.at((now_ns - self._begin_ns) * 1e-9) for axis in self._axes)
        acceleration = (x[2], y[2], z[2])
        self._from = Motion((x[0], y[0], z[0]), (x[1], y[1], z[1]), acceleration, turn[0])
        return Position(self._from.position, self._from.velocity, turn[0], math.nan), acceleration
