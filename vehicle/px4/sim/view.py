"""What message builders see of one tick: the snapshot in NED/FRD and derived values, worked out when asked for."""

from __future__ import annotations

import math

import numpy as np

from kernel.rotations import rotate_back, swap_attitude, swap_yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.commander import Commander
from vehicle.px4.sim.control import (
    ACC_SP,
    ATT_THRUST,
    MODE,
    OUT_ATT,
    OUT_RATE,
    OUT_THRUST,
    POS_SP,
    POSITION,
    SMOOTH,
    VEL_SMOOTH,
    VEL_SP,
    YAW_SMOOTH,
)
from vehicle.px4.sim.estimator import Estimator
from vehicle.px4.sim.plant import GROUND, NSNAP, S_EULER, TICK_NS, snapshot
from vehicle.px4.sim.state import Flight
from vehicle.quadrotor import state_row

FULL_MV, EMPTY_MV, EMPTY_PERCENT = 16200, 15300, 51  # SIM_BAT_*: what a SITL battery shows
DRAIN_S = 30.0  # armed, from full to empty
EPOCH_US = 1_767_225_600_000_000  # 2026-01-01: simulated PX4s boot at new year


def diagonal(*values: float) -> tuple[float, ...]:
    """Upper triangle of a 6x6 matrix with these diagonal elements, NaN elsewhere; missing ones are NaN too."""
    out = [math.nan] * 21
    for i, value in enumerate(values):
        out[6 * i - i * (i - 1) // 2] = value
    return tuple(out)


class View:
    """Read-only picture of the autopilot for one tick; `refresh` starts the next one."""

    def __init__(
        self, flight: Flight, commander: Commander, estimator: Estimator, noise: np.ndarray, stream: np.ndarray
    ):
        self.flight, self.commander, self.estimator = flight, commander, estimator
        self._noise, self._stream = noise, stream
        self._snapshot = np.zeros(NSNAP)
        self._snap: list[float] | None = None
        self._geodetic: tuple[int, int, int] | None = None
        self._counts: dict[str, int] = {}
        self.us = self.ms = self.sample_us = 0
        self.epoch_us = EPOCH_US
        self.event_sequence = 0xFFF6
        self.reset_counter = 4
        position, velocity, attitude = (max(float(noise[i]) ** 2, 1e-8) for i in (0, 2, 4))
        self.pose_covariance = diagonal(position, position, position, attitude, attitude, attitude)
        self.velocity_covariance = diagonal(velocity, velocity, velocity)
        self.home_attitude = (1.0, 0.0, 0.0, 0.0)

    def refresh(self) -> None:
        """Forget what was worked out for the last tick."""
        self.us = self.flight.now_ns // 1000
        self.ms = self.us // 1000
        self.sample_us = max(0, self.flight.now_ns - TICK_NS) // 1000
        self._snap = self._geodetic = None

    @property
    def snap(self) -> list[float]:
        """The (NSNAP,) snapshot as a list."""
        if self._snap is None:
            flight = self.flight
            snapshot(flight.row, flight.estimate, self._noise, self._stream, *flight.origin, self._snapshot)
            self._snap = self._snapshot.tolist()
        return self._snap

    @property
    def geodetic(self) -> tuple[int, int, int]:
        """Latitude, longitude (1e-7 deg) and altitude (mm above sea level) of the estimate."""
        if self._geodetic is None:
            x, y, z = self.flight.position
            self._geodetic = (*self.flight.geodetic(x, y), round(self.flight.altitude(z) * 1000))
        return self._geodetic

    def count(self, name: str) -> int:
        """0, 1, 2, ... per name."""
        value = self._counts.get(name, 0)
        self._counts[name] = value + 1
        return value

    def height(self) -> float:
        """Distance to the ground below, m."""
        return float(self.flight.row[2]) - float(self.flight.situation[GROUND])

    @property
    def thrust(self) -> float:
        """Collective command of this tick, 0..1."""
        return float(self.flight.control[OUT_THRUST])

    def servos(self) -> tuple[int, ...]:
        """Pulse widths of the four motors while armed."""
        return tuple(
            round(1000 + 1000 * u) for u in self.flight.row[state_row.COMMAND : state_row.COMMAND + 4].tolist()
        )

    def motors(self) -> tuple[float, ...]:
        """Thrust of the four motors over full thrust."""
        return tuple(self.flight.row[state_row.MOTOR : state_row.MOTOR + 4].tolist())

    def battery(self) -> tuple[int, int]:
        """Millivolts and percent."""
        used = self.flight.discharge
        return round(FULL_MV - used * (FULL_MV - EMPTY_MV)), round(100 - used * (100 - EMPTY_PERCENT))

    def attitude_setpoint(self) -> tuple[tuple[float, float, float, float], float]:
        """The cascade's last attitude set-point (NED from FRD) and thrust."""
        c = self.flight.control
        if math.isnan(c[OUT_ATT]):
            return (1.0, 0.0, 0.0, 0.0), 0.001
        w, x, y, z = swap_attitude(tuple(c[OUT_ATT : OUT_ATT + 4].tolist()))
        return ((w, x, y, z) if w >= 0 else (-w, -x, -y, -z)), float(c[ATT_THRUST])

    def rate_setpoint(self) -> tuple[float, float, float]:
        """Body rate set-points, FRD."""
        x, y, z = self.flight.control[OUT_RATE : OUT_RATE + 3].tolist()
        return x, -y, -z

    def position_setpoint(self) -> tuple[float, ...] | None:
        """Mask, position, velocity, acceleration, yaw, yaw rate (NED) of POSITION_TARGET_LOCAL_NED; None: not sent."""
        flight, c = self.flight, self.flight.control
        if flight.active == px4.OFFBOARD and flight.setpoint.kind != "position":
            return None
        if c[MODE] != POSITION:
            nan = math.nan
            return 63, nan, nan, nan, nan, nan, nan, 0.0, 0.0, 100.0, self.snap[S_EULER + 2], 0.0
        x, y, z = c[POS_SP : POS_SP + 3].tolist()
        ox, oy, oz = flight.origin
        vx, vy, vz = c[VEL_SMOOTH : VEL_SMOOTH + 3].tolist() if c[SMOOTH] > 0 else c[VEL_SP : VEL_SP + 3].tolist()
        ax, ay, az = c[ACC_SP : ACC_SP + 3].tolist()
        heading = swap_yaw(float(c[YAW_SMOOTH]))
        return 0, y - oy, x - ox, oz - z, vy, vx, -vz, _zero(ay), _zero(ax), -_zero(az), heading, 0.0

    def truth_ned(self) -> tuple:
        """Ground truth: position, velocity NED, quaternion (tuple), rates FRD, specific force FRD as one flat tuple."""
        row, (ox, oy, oz) = self.flight.row, self.flight.origin
        x, y, z, vx, vy, vz, *q = row[:10].tolist()
        wx, wy, wz = row[10:13].tolist()
        fx, fy, fz = row[20:23].tolist()
        attitude = swap_attitude(tuple(q))
        gravity = rotate_back(attitude, 0.0, 0.0, 9.80665)
        acceleration = (fx + gravity[0], -fy + gravity[1], -fz + gravity[2])
        return (y - oy, x - ox, oz - z, vy, vx, -vz, *attitude, wx, -wy, -wz, *acceleration)


def _zero(value: float) -> float:
    return 0.0 if math.isnan(value) else value
