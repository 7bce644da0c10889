"""What message builders read of one tick: the snapshot in NED/FRD and derived values, computed on demand."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kernel.rotations import rotate_back, swap_attitude, swap_yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.commander import Commander
from vehicle.px4.sim.estimator import Estimator
from vehicle.px4.sim.plant import TICK_NS, fill_snapshot
from vehicle.px4.sim.rows import control, estimate_noise, situation, snapshot
from vehicle.px4.sim.state import Flight
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import GRAVITY

FULL_MV, EMPTY_MV, EMPTY_PERCENT = 16200, 15300, 51  # SIM_BAT_*: what a SITL battery shows
_SIGMAS = (estimate_noise.POSITION_SIGMA, estimate_noise.VELOCITY_SIGMA, estimate_noise.ATTITUDE_SIGMA)
DRAIN_S = 30.0  # armed, from full to empty
EPOCH_US = 1_767_225_600_000_000  # 2026-01-01: simulated PX4s boot at new year


Vec3 = tuple[float, float, float]


def diagonal(*values: float) -> tuple[float, ...]:
    """Upper triangle of a 6x6 matrix with these diagonal elements, NaN elsewhere; missing ones are NaN too."""
    out = [math.nan] * 21
    for i, value in enumerate(values):
        out[6 * i - i * (i - 1) // 2] = value
    return tuple(out)


class TruthNed(NamedTuple):
    """Where the vehicle really is, as SIH reports it: NED and FRD, SI units, relative to PX4's local origin."""

    position: Vec3
    velocity: Vec3
    attitude: tuple[float, float, float, float]  # NED from FRD
    rates: Vec3
    acceleration: Vec3  # of motion, gravity included, in the body


class View:
    """Read-only view of the autopilot in one tick; `refresh` starts the next one."""

    def __init__(
        self, flight: Flight, commander: Commander, estimator: Estimator, noise: np.ndarray, stream: np.ndarray
    ):
        self.flight, self.commander, self.estimator = flight, commander, estimator
        self._noise, self._stream = noise, stream
        self._snapshot = np.zeros(snapshot.LENGTH)
        self._snap: list[float] | None = None
        self._geodetic: tuple[int, int, int] | None = None
        self._counts: dict[str, int] = {}
        self.us = self.ms = self.sample_us = 0
        self.epoch_us = EPOCH_US
        self.event_sequence = 0xFFF6
        self.reset_counter = 4
        position, velocity, attitude = (max(float(noise[i]) ** 2, 1e-8) for i in _SIGMAS)
        self.pose_covariance = diagonal(position, position, position, attitude, attitude, attitude)
        self.velocity_covariance = diagonal(velocity, velocity, velocity)
        self.home_attitude = (1.0, 0.0, 0.0, 0.0)

    def refresh(self) -> None:
        """Drop the values of the last tick."""
        self.us = self.flight.now_ns // 1000
        self.ms = self.us // 1000
        self.sample_us = max(0, self.flight.now_ns - TICK_NS) // 1000
        self._snap = self._geodetic = None

    @property
    def snap(self) -> list[float]:
        """The snapshot row as a list."""
        if self._snap is None:
            flight = self.flight
            fill_snapshot(flight.row, flight.estimate, self._noise, self._stream, *flight.origin, self._snapshot)
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
        return self.flight.true_position[2] - float(self.flight.situation[situation.GROUND])

    @property
    def thrust(self) -> float:
        """Collective command of this tick, 0..1."""
        return float(self.flight.control[control.OUT_THRUST])

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
        if math.isnan(c[control.OUT_ATT]):
            return (1.0, 0.0, 0.0, 0.0), 0.001
        w, x, y, z = swap_attitude(tuple(c[control.OUT_ATT : control.OUT_ATT + 4].tolist()))
        return ((w, x, y, z) if w >= 0 else (-w, -x, -y, -z)), float(c[control.ATT_THRUST])

    def rate_setpoint(self) -> tuple[float, float, float]:
        """Body rate set-points, FRD."""
        x, y, z = self.flight.control[control.OUT_RATE : control.OUT_RATE + 3].tolist()
        return x, -y, -z

    def position_setpoint(self) -> tuple[float, ...] | None:
        """Mask, position, velocity, acceleration, yaw, yaw rate (NED) of POSITION_TARGET_LOCAL_NED; None: not sent."""
        flight, c = self.flight, self.flight.control
        if flight.active == px4.OFFBOARD and flight.setpoint.kind != "position":
            return None
        if c[control.MODE] != control.POSITION:
            nan = math.nan
            return 63, nan, nan, nan, nan, nan, nan, 0.0, 0.0, 100.0, self.snap[snapshot.EULER + 2], 0.0
        x, y, z = c[control.POS_SP : control.POS_SP + 3].tolist()
        ox, oy, oz = flight.origin
        at = control.VEL_SMOOTH if c[control.SMOOTH] > 0 else control.VEL_SP
        vx, vy, vz = c[at : at + 3].tolist()
        ax, ay, az = c[control.ACC_SP : control.ACC_SP + 3].tolist()
        heading = swap_yaw(float(c[control.YAW_SMOOTH]))
        return 0, y - oy, x - ox, oz - z, vy, vx, -vz, _zero(ay), _zero(ax), -_zero(az), heading, 0.0

    def truth_ned(self) -> TruthNed:
        """Ground truth of this tick."""
        flight, row = self.flight, self.flight.row
        x, y, z = flight.true_position
        vx, vy, vz = row[state_row.V : state_row.V + 3].tolist()
        w, qx, qy, qz = row[state_row.Q : state_row.Q + 4].tolist()
        wx, wy, wz = row[state_row.W : state_row.W + 3].tolist()
        fx, fy, fz = row[state_row.F : state_row.F + 3].tolist()
        ox, oy, oz = flight.origin
        attitude = swap_attitude((w, qx, qy, qz))
        gx, gy, gz = rotate_back(attitude, 0.0, 0.0, GRAVITY)
        return TruthNed(
            (y - oy, x - ox, oz - z), (vy, vx, -vz), attitude, (wx, -wy, -wz), (fx + gx, -fy + gy, -fz + gz)
        )


def _zero(value: float) -> float:
    return 0.0 if math.isnan(value) else value
