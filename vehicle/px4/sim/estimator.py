"""The software PX4's estimate: truth with small correlated errors, aided by GPS, by external vision, or not at all.

It is no EKF: it models the errors of the estimate and the sources on which they depend. Defaults are for a vehicle on
motion capture; `GPS_NOISE` is measured on the recorded SITL flight with simulated GPS.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import astuple, dataclass

import numpy as np

from kernel.random import normal
from kernel.rotations import swap_attitude, swap_yaw, wrap_angle, yaw
from vehicle.px4.place import ORIGIN_ALTITUDE
from vehicle.px4.sim.rows import estimate_error, estimate_noise
from vehicle.px4.sim.state import Flight
from vehicle.quadrotor import state_row

EV_ALIGN_S = 1.0  # of steady vision before it is fused
EV_TIMEOUT_S = 1.5
DEAD_RECKONING_S = 5.0  # EKF2_NOAID_TOUT
DRIFT = 0.05  # m/s^2/sqrt(Hz), of dead reckoning
EV_GAIN = 0.3  # share of a vision sample's innovation that corrects the estimate


@dataclass(frozen=True)
class EstimatorNoise:
    """One-sigma errors and their time constants (s); gyro and accelerometer noise is white, per sample."""

    position: float = 0.005  # m
    position_tau: float = 1.0
    velocity: float = 0.02  # m/s
    velocity_tau: float = 0.2
    attitude: float = 0.003  # rad
    attitude_tau: float = 2.0
    gyro: tuple[float, float, float] = (0.08, 0.04, 0.016)  # rad/s, as PX4's ODOMETRY shows the vibrations of SIH
    accelerometer: float = 0.07  # m/s^2

    def row(self) -> np.ndarray:
        """The noise row for kernels. Raises ValueError for negative or non-finite numbers."""
        values = np.hstack(astuple(self))
        if not np.isfinite(values).all() or values.min() < 0 or min(values[list(_TAUS)]) <= 0:
            raise ValueError(f"estimator noise must be finite, not negative, with positive time constants: {self}")
        return values


_TAUS = (estimate_noise.POSITION_TAU, estimate_noise.VELOCITY_TAU, estimate_noise.ATTITUDE_TAU)
GPS_NOISE = EstimatorNoise(position=0.2, position_tau=8.0, velocity=0.12, velocity_tau=0.8)


class Estimator:
    """Decides which source aids the estimate and sets the error row accordingly."""

    def __init__(self, flight: Flight, stream: np.ndarray) -> None:
        self._flight, self._stream = flight, stream
        self.error = np.zeros(estimate_error.LENGTH)
        parameters = flight.parameters
        self._gps_fitted = bool(parameters["SENS_EN_GPSSIM"]) and bool(parameters["SYS_HAS_GPS"])
        self._height_reference = parameters["EKF2_HGT_REF"]
        self.gps_enabled = True  # fault hook
        self.vision_active = False
        self.yaw_aligned = True  # False while vision comes in a frame that is not north-aligned
        self._vision_since = self._vision_last = -1
        self._aided_ns = 0
        self._history: deque[tuple[int, float, float, float, float]] = deque(maxlen=64)

    @property
    def gps_active(self) -> bool:
        """True while GPS is received (whether or not it is fused)."""
        return self._gps_fitted and self.gps_enabled

    @property
    def vision_used(self) -> bool:
        """True if vision may be fused, so that the truth has to be remembered."""
        return self._flight.parameters["EKF2_EV_CTRL"] != 0

    def remember(self) -> None:
        """Store the truth, as vision comes delayed; called every tick."""
        row = self._flight.row
        heading = yaw(tuple(row[state_row.Q : state_row.Q + 4]))
        x, y, z = row[state_row.P : state_row.P + 3].tolist()
        self._history.append((self._flight.now_ns, x, y, z, heading))

    def vision(self, ned: tuple[float, float, float], heading_ned: float, north_aligned: bool) -> None:
        """A vision pose (position NED in the local frame, heading rad from north); NaN is dropped by the caller."""
        flight = self._flight
        now, control = flight.now_ns, int(flight.parameters["EKF2_EV_CTRL"])
        if control == 0:
            return
        if self._vision_last < 0 or now - self._vision_last > EV_TIMEOUT_S * 1e9:
            self._vision_since = now
        self._vision_last = now
        if now - self._vision_since < EV_ALIGN_S * 1e9:
            return
        if not self.vision_active:
            self.vision_active = True
            self._take(ned, heading_ned, north_aligned, control, 1.0)
        self._take(ned, heading_ned, north_aligned, control, EV_GAIN)

    def _take(self, ned: tuple[float, float, float], heading: float, aligned: bool, control: int, gain: float) -> None:
        """Let the error follow vision: its pose less the truth of when it was taken (EKF2_EV_DELAY before now)."""
        if self._fuses_gps() or not self._history:
            return
        flight, error = self._flight, self.error
        taken = flight.now_ns - int(flight.parameters["EKF2_EV_DELAY"] * 1e6)
        _, x, y, z, yaw_then = min(self._history, key=lambda entry: abs(entry[0] - taken))
        ox, oy, oz = flight.origin
        wanted = (ned[1] + ox - x, ned[0] + oy - y, oz - ned[2] - z)
        bias = estimate_error.POSITION_BIAS
        for axis in range(2):
            if control & 1:
                error[bias + axis] += gain * (wanted[axis] - error[bias + axis])
        if control & 2:
            jump = ORIGIN_ALTITUDE if self._height_jumps() else 0.0
            error[bias + 2] += gain * (wanted[2] - jump - error[bias + 2])
        self.yaw_aligned = aligned
        if control & 8 and aligned:
            innovation = wrap_angle(swap_yaw(heading) - yaw_then - error[estimate_error.YAW_BIAS])
            error[estimate_error.YAW_BIAS] += gain * innovation

    def _height_jumps(self) -> bool:
        """A running PX4 that is switched to vision height offsets z by its altitude: set it before boot."""
        return self._flight.parameters["EKF2_HGT_REF"] == 3 and self._height_reference != 3

    def _fuses_gps(self) -> bool:
        return self.gps_active and self._flight.parameters["EKF2_GPS_CTRL"] != 0

    def update(self, dt: float) -> None:
        """Run at the commander's rate: which source is alive, what is valid, how dead reckoning drifts."""
        flight, error, now = self._flight, self.error, self._flight.now_ns
        if self.vision_active and (
            now - self._vision_last > EV_TIMEOUT_S * 1e9 or flight.parameters["EKF2_EV_CTRL"] == 0
        ):
            self.vision_active = False
        gps = self._fuses_gps()
        seen = self.vision_active and bool(int(flight.parameters["EKF2_EV_CTRL"]) & 1)
        if gps:
            for i in range(estimate_error.POSITION_BIAS, estimate_error.YAW_BIAS + 1):
                error[i] *= 0.98
        if gps or seen:
            self._aided_ns = now
            error[estimate_error.BLIND] = 0.0
            for axis in range(3):
                error[estimate_error.VELOCITY_BIAS + axis] *= 0.9
        elif error[estimate_error.BLIND] == 0.0:
            for axis in range(2):
                error[estimate_error.VELOCITY_BIAS + axis] += DRIFT * math.sqrt(dt) * normal(self._stream)
                error[estimate_error.POSITION_BIAS + axis] += dt * error[estimate_error.VELOCITY_BIAS + axis]
        never = self._aided_ns == 0 and not (gps or seen)
        if never or now - self._aided_ns > DEAD_RECKONING_S * 1e9:
            if error[estimate_error.BLIND] == 0.0:
                known = flight.origin if never else flight.position
                error[estimate_error.KNOWN_X], error[estimate_error.KNOWN_Y] = known[0], known[1]
            error[estimate_error.BLIND] = 1.0
        flight.position_valid = error[estimate_error.BLIND] == 0.0 and flight.now_s > 2.7
        flight.global_valid = flight.position_valid and gps

    def heading_ned(self) -> float:
        """Estimated heading from north, rad."""
        return yaw(swap_attitude(self._flight.attitude))
