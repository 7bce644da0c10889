"""Simulated sensors of an autopilot: what accelerometer, gyro, magnetometer, barometer and GPS show of a state row.

Each reading is the truth of that moment plus a bias drawn once a flight and white noise of one sample. GPS is of the
kind that hovers well (RTK): a slow first-order Gauss-Markov error of position, white noise of velocity.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np

from kernel.jit import njit
from kernel.random import normal
from kernel.rotations import rotate_back
from vehicle.px4 import place
from vehicle.px4.hitl import rows
from vehicle.px4.place import air_pressure
from vehicle.px4.sim.cascade import quaternion_at
from vehicle.quadrotor import state_row

NORTH, EAST, DOWN = place.FIELD_NED
_ORIGIN = place.ORIGIN_ALTITUDE


@dataclass(frozen=True)
class SensorNoise:
    """One-sigma noise of a sample and bias of a flight, in rows' order. The defaults are those of small IMUs under
    vibration, well inside what PX4's estimator assumes (EKF2_ACC_NOISE 0.35, EKF2_GYR_NOISE 0.015, EKF2_BARO_NOISE
    3.5 m, EKF2_MAG_NOISE 0.05)."""

    accelerometer: float = 0.07  # m/s^2
    gyro: float = 0.007  # rad/s
    magnetometer: float = 0.003  # gauss
    barometer: float = 1.5  # Pa
    accelerometer_bias: float = 0.02
    gyro_bias: float = 0.002
    magnetometer_bias: float = 0.002
    barometer_bias: float = 30.0
    gps: float = 0.01  # m
    gps_tau: float = 10.0  # s
    gps_velocity: float = 0.02  # m/s

    def row(self) -> np.ndarray:
        """The (rows.NOISE_LENGTH,) row. Raises ValueError for negative or non-finite numbers."""
        values = np.array(astuple(self))
        if not np.isfinite(values).all() or values.min() < 0 or self.gps_tau <= 0:
            raise ValueError(f"sensor noise must be finite and not negative, with a positive gps_tau: {self}")
        return values


QUIET = SensorNoise(*(0.0,) * 9, gps_tau=1.0, gps_velocity=0.0)
"""Sensors without any error."""


def draw_errors(noise: np.ndarray, stream: np.ndarray) -> np.ndarray:
    """The (rows.ERROR_LENGTH,) row of one flight: biases of its sensors, first position error of GPS."""
    error = np.zeros(rows.ERROR_LENGTH)
    sigmas = (rows.ACCEL_BIAS, rows.GYRO_BIAS, rows.MAG_BIAS)
    for at, sigma in zip((rows.BIAS_ACCEL, rows.BIAS_GYRO, rows.BIAS_MAG), sigmas, strict=True):
        for axis in range(3):
            error[at + axis] = noise[sigma] * normal(stream)
    error[rows.BIAS_PRESSURE] = noise[rows.PRESSURE_BIAS] * normal(stream)
    for axis in range(3):
        error[rows.GPS_ERROR + axis] = noise[rows.GPS_SIGMA] * normal(stream)
    return error


@njit
def sense(row, error, noise, stream, out):
    """Fill the reading row `out` (rows.READING_LENGTH,) from a state row; world ENU and body FLU in, FRD out."""
    sign = (1.0, -1.0, -1.0)
    north_east_down = rotate_back(quaternion_at(row, state_row.Q), EAST, NORTH, -DOWN)
    for axis in range(3):
        force = sign[axis] * row[state_row.F + axis] + error[rows.BIAS_ACCEL + axis]
        rate = sign[axis] * row[state_row.W + axis] + error[rows.BIAS_GYRO + axis]
        field = sign[axis] * north_east_down[axis] + error[rows.BIAS_MAG + axis]
        out[rows.ACCEL + axis] = force + noise[rows.ACCEL_SIGMA] * normal(stream)
        out[rows.GYRO + axis] = rate + noise[rows.GYRO_SIGMA] * normal(stream)
        out[rows.MAG + axis] = field + noise[rows.MAG_SIGMA] * normal(stream)
    altitude = _ORIGIN + row[state_row.P + 2]
    pressure = air_pressure(altitude) + error[rows.BIAS_PRESSURE] + noise[rows.PRESSURE_SIGMA] * normal(stream)
    out[rows.PRESSURE] = 0.01 * pressure
    out[rows.DIFFERENTIAL] = 0.0
    out[rows.PRESSURE_ALTITUDE] = altitude
    out[rows.TEMPERATURE] = 25.0


@njit
def sense_gps(row, error, noise, stream, dt, out):
    """GPS after `dt` s since its last fix: position and velocity (6,) in the world, m and m/s."""
    keep = math.exp(-dt / noise[rows.GPS_TAU])
    drive = noise[rows.GPS_SIGMA] * math.sqrt(1.0 - keep * keep)
    for axis in range(3):
        error[rows.GPS_ERROR + axis] = keep * error[rows.GPS_ERROR + axis] + drive * normal(stream)
        out[axis] = row[state_row.P + axis] + error[rows.GPS_ERROR + axis]
        out[3 + axis] = row[state_row.V + axis] + noise[rows.GPS_VELOCITY_SIGMA] * normal(stream)
