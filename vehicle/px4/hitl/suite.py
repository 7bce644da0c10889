"""The sensors of one simulated vehicle as PX4's simulator interface wants them, each at its own rate and delay.

A GPS receiver needs time for a fix: PX4's estimator takes one to be EKF2_GPS_DELAY old when it comes. A difference of
0.1 s between the two costs 0.1 m/s and 0.4 m within a few turns.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from vehicle.px4.codec import Packer
from vehicle.px4.hitl import rows
from vehicle.px4.hitl.messages import BARO, COMPONENT, IMU, MAG, SYSTEM, hil_gps, hil_sensor
from vehicle.px4.hitl.sensors import SensorNoise, draw_errors, sense, sense_gps
from vehicle.px4.sim.plant import TICK_NS

MAG_TICKS, BARO_TICKS, GPS_TICKS = 5, 5, 25  # 50, 50 and 10 Hz
GPS_DELAY_TICKS = 28  # of a fix, as PX4 assumes by default
GPS_DELAY_MS = 108.0  # the same as EKF2_GPS_DELAY: PX4 stamps a fix with its clock of the tick before

STUCK = {
    "accelerometer": slice(rows.ACCEL, rows.ACCEL + 3),
    "gyro": slice(rows.GYRO, rows.GYRO + 3),
    "magnetometer": slice(rows.MAG, rows.MAG + 3),
    "barometer": slice(rows.PRESSURE, rows.PRESSURE_ALTITUDE + 1),
}
"""Sensor: its part of the reading row, which a stuck sensor repeats."""


class SensorSuite:
    """Reads a state row; `messages` gives what is due. Its public attributes break sensors."""

    def __init__(self, row: np.ndarray, noise: SensorNoise, stream: np.ndarray, gps: bool) -> None:
        """`row`: the vehicle's state row, read and not changed. `gps`: False where there is no receiver."""
        self._row, self._gps, self._stream = row, gps, stream
        self._noise = noise.row()
        self._error = draw_errors(self._noise, stream)
        self._fixes: deque[tuple[int, np.ndarray]] = deque()  # the tick at which each comes out of the receiver
        self._last_fix = np.zeros(6)
        self._ticks = 0
        self.packer = Packer(SYSTEM, COMPONENT)
        self.reading = np.zeros(rows.READING_LENGTH)
        self.stuck: set[str] = set()  # of STUCK and "gps"
        self.gps_lost = False
        self.gps_offset = np.zeros(3)  # m, world

    def messages(self, time_us: int) -> list[bytes]:
        """HIL_GPS if a fix is due, then HIL_SENSOR, of the next tick, whose time is `time_us` (us) of the firmware."""
        out: list[bytes] = []
        if self._gps:
            self._measure_fix()
            if self._fixes and self._fixes[0][0] == self._ticks:
                out += self._fix(time_us, self._fixes.popleft()[1])
        fields = IMU
        fields |= MAG if self._ticks % MAG_TICKS == 0 else 0
        fields |= BARO if self._ticks % BARO_TICKS == 0 else 0
        before = self.reading.copy() if self.stuck else self.reading
        sense(self._row, self._error, self._noise, self._stream, self.reading)
        for name, part in STUCK.items():
            if name in self.stuck:
                self.reading[part] = before[part]
        self._ticks += 1
        return [*out, hil_sensor(self.packer, time_us, self.reading, fields)]

    def _measure_fix(self) -> None:
        if self._ticks % GPS_TICKS == 0:
            fix = np.zeros(6)
            sense_gps(self._row, self._error, self._noise, self._stream, GPS_TICKS * TICK_NS * 1e-9, fix)
            self._fixes.append((self._ticks + GPS_DELAY_TICKS, fix))

    def _fix(self, time_us: int, fix: np.ndarray) -> list[bytes]:
        if "gps" not in self.stuck:
            self._last_fix = fix
            self._last_fix[:3] += self.gps_offset
        return [] if self.gps_lost else [hil_gps(self.packer, time_us, self._last_fix)]
