"""Which set-point flies: the radio's over the high-level commander's, and what each asks of the control loops."""

from __future__ import annotations

import math

import numpy as np

from kernel.rotations import from_euler
from vehicle.crazyflie.commands import Attitude, Position, Rates, Setpoint, Stop, Vec3
from vehicle.crazyflie.sim.high_level import HighLevel
from vehicle.crazyflie.thrust import force_of
from vehicle.px4.sim.rows import control

_LOCKED_BELOW, _MOST = 1000, 60000  # thrust words of the legacy set-point


class Commander:
    """Keeps the newest set-point and its time (ns since boot)."""

    def __init__(self, high_level: HighLevel) -> None:
        self.high_level = high_level
        self.setpoint: Setpoint = Stop()
        self.acceleration: Vec3 = (0.0, 0.0, 0.0)
        self.stamp_ns = 0
        self.from_radio = False
        self._thrust_locked = True

    def legacy(self, now_ns: int, setpoint: Setpoint) -> None:
        """A set-point of the legacy port: thrust stays locked until a word of 0 has come."""
        if isinstance(setpoint, Rates | Attitude):
            if setpoint.word == 0:
                self._thrust_locked = False
            low = self._thrust_locked or setpoint.word < _LOCKED_BELOW
            setpoint = setpoint._replace(word=0 if low else min(setpoint.word, _MOST))
        self.take(now_ns, setpoint)

    def take(self, now_ns: int, setpoint: Setpoint) -> None:
        """A set-point of the radio; it ends what the high-level commander flies."""
        self.setpoint, self.acceleration, self.stamp_ns = setpoint, (0.0, 0.0, 0.0), now_ns
        self.from_radio = True
        self.high_level.stop()

    def relax(self, position: Vec3, yaw: float) -> None:
        """The radio's set-points end: the high-level commander may fly again, from where the vehicle is."""
        self.from_radio = False
        if self.high_level.state == "idle":
            self.high_level.tell(position, yaw)

    def update(self, now_ns: int, position: Vec3, yaw: float) -> None:
        """The high-level commander's set-point, where the radio gives none."""
        planned = self.high_level.setpoint(now_ns, position, yaw)
        if self.from_radio:
            return
        self.stamp_ns = now_ns
        self.setpoint, self.acceleration = (Stop(), (0.0, 0.0, 0.0)) if planned is None else planned

    def thrusts(self) -> bool:
        """Whether the set-point asks for any thrust."""
        setpoint = self.setpoint
        return isinstance(setpoint, Position) or (isinstance(setpoint, Rates | Attitude) and setpoint.word > 0)


def apply(
    setpoint: Setpoint, acceleration: Vec3, level: bool, heading: float, limit: float, full: float, c: np.ndarray
) -> None:
    """Write a set-point into the control row `c` (vehicle.px4.sim.rows.control).

    `level`: set-points have stopped, fly level and keep thrust or height. `heading` (rad) is the vehicle's. `limit`:
    the most that the battery gives, N per motor; `full`: N per motor at command 1.
    """
    c[control.YAW_SP], c[control.YAW_RATE_SP] = heading, math.nan
    most = limit / full
    c[control.THR_MAX] = min(1.0, most)
    if isinstance(setpoint, Position):
        c[control.MODE] = control.POSITION
        position, velocity = setpoint.position, setpoint.velocity
        c[control.YAW_SP], c[control.YAW_RATE_SP] = setpoint.yaw, setpoint.yaw_rate
        if level:
            position = (math.nan, math.nan, position[2])
            velocity = (math.nan, math.nan, velocity[2])
            acceleration = (0.0, 0.0, acceleration[2])
            c[control.YAW_SP], c[control.YAW_RATE_SP] = heading, math.nan
        for axis in range(3):
            c[control.POS_SP + axis], c[control.VEL_SP + axis] = position[axis], velocity[axis]
            c[control.ACC_SP + axis] = acceleration[axis]
        return
    word = setpoint.word if isinstance(setpoint, Rates | Attitude) else 0
    c[control.THRUST_SP] = min(1.0, most, force_of(word) / full)
    if isinstance(setpoint, Rates) and not level:
        c[control.MODE] = control.RATES
        c[control.RATE_SP : control.RATE_SP + 3] = setpoint.body_rate
        return
    attitude = setpoint if isinstance(setpoint, Attitude) and not level else Attitude(0.0, 0.0, 0.0, word)
    c[control.MODE] = control.ATTITUDE
    c[control.ATT_SP : control.ATT_SP + 4] = from_euler(attitude.roll, attitude.pitch, heading)
    c[control.YAW_RATE_SP] = attitude.yaw_rate
