"""The way from the take-off to the hover at the start: smooth set-points, rest, hover thrust."""

from __future__ import annotations

import math
from typing import Protocol

from kernel.rotations import wrap_angle, yaw
from vehicle.px4.driver.types import Odometry, Vec3

_HEADING = 0.1  # rad, of the hover
_CALM_S = 0.1  # body rates are averaged over: single ones show the frame's vibrations
_ENOUGH = 5  # thrust samples
_FEED_FORWARD = 0.7  # share of the set-point's velocity: all of it overshoots, as PX4's velocity loop lags


class Hovering(Protocol):
    """What a driver's configuration says of the start and of the hover there; see `LinkConfig`."""

    @property
    def start(self) -> tuple[float, float, float, float]: ...
    @property
    def goto_speed(self) -> float: ...
    @property
    def goto_acceleration(self) -> float: ...
    @property
    def hover_position(self) -> float: ...
    @property
    def hover_speed(self) -> float: ...
    @property
    def hover_turning(self) -> float: ...
    @property
    def hover_time(self) -> float: ...


class Approach:
    """Moves a set-point to the start and judges whether the vehicle has come to rest there."""

    def __init__(self, config: Hovering) -> None:
        self._config = config
        self._point: Vec3 | None = None
        self._speed = 0.0
        self._still_ns: int | None = None
        self._turning, self._turning_ns = (0.0, 0.0, 0.0), 0

    def begin(self, position: Vec3, velocity: Vec3) -> None:
        """The set-point starts where the vehicle is, as fast as it moves towards the start."""
        goal = self._config.start[:3]
        away = [b - a for a, b in zip(position, goal, strict=True)]
        towards = sum(a * v for a, v in zip(away, velocity, strict=True)) / max(1e-6, math.hypot(*away))
        self._point, self._speed, self._still_ns = position, max(0.0, towards), None

    def advance(self, seconds: float) -> tuple[Vec3, Vec3]:
        """Position and velocity set-point `seconds` later: straight to the start and to rest there.

        Within goto_speed and goto_acceleration. The velocity feeds forward, so that the vehicle lags little.
        """
        config, goal = self._config, self._config.start[:3]
        here = goal if self._point is None else self._point
        distance = math.dist(here, goal)
        most = config.goto_acceleration
        self._speed = min(config.goto_speed, self._speed + most * seconds, math.sqrt(2.0 * most * distance))
        step = self._speed * seconds
        if distance < 0.002 or step >= distance:
            self._point, self._speed = goal, 0.0
            return goal, (0.0, 0.0, 0.0)
        ux, uy, uz = ((b - a) / distance for a, b in zip(here, goal, strict=True))
        self._point = (here[0] + step * ux, here[1] + step * uy, here[2] + step * uz)
        ahead = _FEED_FORWARD * self._speed
        return self._point, (ahead * ux, ahead * uy, ahead * uz)

    def settled(self, now_ns: int, vehicle: Odometry | None) -> bool:
        """True once the vehicle has been at rest at the start for `hover_time`."""
        config = self._config
        near = (
            vehicle is not None
            and math.dist(vehicle.position, config.start[:3]) < config.hover_position
            and math.hypot(*vehicle.velocity) < config.hover_speed
            and math.hypot(*self._mean_turning(vehicle)) < config.hover_turning
            and abs(wrap_angle(yaw(vehicle.orientation) - config.start[3])) < _HEADING
        )
        if not near:
            self._still_ns = None
            return False
        self._still_ns = now_ns if self._still_ns is None else self._still_ns
        return now_ns - self._still_ns >= config.hover_time * 1e9

    def _mean_turning(self, vehicle: Odometry) -> Vec3:
        """Body rates, averaged over the last `_CALM_S`."""
        share = min(1.0, (vehicle.stamp_ns - self._turning_ns) * 1e-9 / _CALM_S)
        mean, self._turning_ns = self._turning, vehicle.stamp_ns
        p, q, r = (old + share * (new - old) for old, new in zip(mean, vehicle.body_rate, strict=True))
        self._turning = (p, q, r)
        return self._turning

    @property
    def at_rest(self) -> bool:
        """True while within the tolerances, for any time."""
        return self._still_ns is not None


class HoverThrust:
    """Thrust that holds the vehicle's weight, averaged over its hover from ATTITUDE_TARGET (stale in rate mode)."""

    def __init__(self, expected: float, tolerance: float) -> None:
        self._expected, self._tolerance = expected, tolerance
        self.value, self.samples = 0.0, 0

    def add(self, thrusts: list[float]) -> None:
        """New samples, all taken with the vehicle at rest. An average over about the last fifty."""
        for thrust in thrusts:
            self.samples += 1
            self.value += (thrust - self.value) / min(self.samples, 50)

    @property
    def known(self) -> bool:
        """True once there are enough samples."""
        return self.samples >= _ENOUGH

    def complaint(self) -> str:
        """Why the hover thrust does not match the airframe file; empty if it does."""
        if abs(self.value / self._expected - 1.0) <= self._tolerance:
            return ""
        return (
            f"hover thrust is {self.value:.3f}, the airframe file gives {self._expected:.3f}: "
            "wrong airframe file, wrong payload, or a weak battery"
        )
