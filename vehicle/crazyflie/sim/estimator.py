"""The software Crazyflie's estimate: truth with small correlated errors, held by external poses, drifting without them.

It is no Kalman filter: it models how the estimate depends on its one source. The firmware takes an external pose as of
its arrival, so that a late pose pulls the estimate of a moving vehicle back.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.random import normal
from kernel.rotations import wrap_angle, yaw
from vehicle.crazyflie.commands import Quat, Vec3
from vehicle.px4.sim.rows import estimate_error, estimate_noise

AIDED_NS = 500_000_000  # after the last external pose the estimate still counts as held
_GAIN = 0.2  # share of an external pose's innovation that corrects the estimate
_DRIFT = 0.2  # m/s^2/sqrt(Hz), of dead reckoning
_VARIANCE, _UNKNOWN = 1e-4, 1.0  # m^2 of a held axis, and of one that never was

NOISE = np.zeros(estimate_noise.LENGTH)
NOISE[estimate_noise.POSITION_SIGMA], NOISE[estimate_noise.POSITION_TAU] = 0.003, 0.5  # m, s
NOISE[estimate_noise.VELOCITY_SIGMA], NOISE[estimate_noise.VELOCITY_TAU] = 0.02, 0.2  # m/s
NOISE[estimate_noise.ATTITUDE_SIGMA], NOISE[estimate_noise.ATTITUDE_TAU] = 0.006, 1.0  # rad
NOISE[estimate_noise.GYRO_SIGMA], NOISE[estimate_noise.ACCEL_SIGMA] = 0.01, 0.1  # rad/s, m/s^2


class Estimator:
    """Keeps the error row of the estimate."""

    def __init__(self, stream: np.ndarray) -> None:
        self.error = np.zeros(estimate_error.LENGTH)
        self._stream = stream
        self._aided_ns: int | None = None
        self.variance = _UNKNOWN  # m^2, of each axis of the position
        self.refused = 0  # external poses that are not finite

    def aided(self, now_ns: int) -> bool:
        return self._aided_ns is not None and now_ns - self._aided_ns < AIDED_NS

    def forget(self) -> None:
        """Begin anew: the next external pose is taken as it is."""
        self._aided_ns, self.variance = None, _UNKNOWN

    def take(self, now_ns: int, position: Vec3, orientation: Quat | None, true: Vec3, attitude: Quat) -> None:
        """An external pose: m and quaternion (w x y z), world; `true` and `attitude` are the vehicle's real ones."""
        if not all(map(math.isfinite, (*position, *(orientation or ())))):
            self.refused += 1
            return
        first, self._aided_ns = not self.aided(now_ns), now_ns
        gain, error = 1.0 if first else _GAIN, self.error
        for axis in range(3):
            at = estimate_error.POSITION_BIAS + axis
            error[at] += gain * (position[axis] - true[axis] - error[at])
            error[estimate_error.VELOCITY_BIAS + axis] *= 1.0 - gain
        if orientation is not None:
            turned = wrap_angle(yaw(orientation) - yaw(attitude) - error[estimate_error.YAW_BIAS])
            error[estimate_error.YAW_BIAS] += gain * turned
        self.variance = _VARIANCE

    def drift(self, now_ns: int, dt: float) -> None:
        """`dt` s of dead reckoning where no external pose holds the estimate."""
        if self.aided(now_ns) or self._aided_ns is None:
            return
        self.variance = min(_UNKNOWN, self.variance + 0.05 * dt)
        for axis in range(3):
            at = estimate_error.VELOCITY_BIAS + axis
            self.error[at] += _DRIFT * math.sqrt(dt) * normal(self._stream)
            self.error[estimate_error.POSITION_BIAS + axis] += dt * self.error[at]
