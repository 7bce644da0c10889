"""How one flight of a Crazyflie begins and what its driver requires; what goes in and comes out is the PX4 driver's."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vehicle.crazyflie.thrust import EMPTY_V, FULL_FORCE
from vehicle.quadrotor.airframe import GRAVITY


@dataclass(frozen=True)
class CrazyflieConfig:
    """`start`: x, y, z (m) and yaw (rad, counter-clockwise from east) of the hover, world, which is also the frame of
    its estimate. `mass`: kg, from the airframe. Times in s. Raises ValueError for numbers out of range.
    """

    start: tuple[float, float, float, float]
    mass: float
    arm: bool = True  # False: waits in phase ready for `CrazyflieLink.allow_arming`
    goto_speed: float = 0.9  # m/s, the most on its way to the start
    goto_acceleration: float = 1.0  # m/s^2
    hover_position: float = 0.15  # m
    hover_speed: float = 0.1  # m/s
    hover_turning: float = 0.25  # rad/s
    hover_time: float = 1.0  # within all three before the hover is reached
    goto_limit: float = 60.0  # to reach the start and come to rest
    hover_thrust_tolerance: float = 0.35  # relative, of the learned hover thrust against the airframe's
    ready_limit: float = 60.0  # for its estimate and its supervisor's checks
    gap_limit: float = 0.25  # without a command after the hand-over: it lands
    answer_limit: float = 0.4  # before a request is repeated
    tries: int = 10
    link_delay: float = 0.002  # from the reading of its estimate to its arrival here, at the least
    clock_drift: float = 1e-4  # of its clock against ours
    least_battery: float = 3.5  # V, before it is armed
    external_pose_hz: float = 100.0

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.start)):
            raise ValueError(f"start {self.start} must be finite")
        if not 0.0 < self.mass * GRAVITY < 4.0 * FULL_FORCE:
            raise ValueError(f"mass {self.mass} kg: a Crazyflie's motors lift {4.0 * FULL_FORCE / GRAVITY:.3f} kg")
        for name in ("goto_speed", "hover_position", "hover_speed", "gap_limit", "answer_limit", "external_pose_hz"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}: it must be positive")
        if not EMPTY_V <= self.least_battery <= 4.2:
            raise ValueError(f"least_battery is {self.least_battery} V: between {EMPTY_V:g} and 4.2")
