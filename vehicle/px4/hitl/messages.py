"""What the simulated vehicle sends by PX4's simulator interface: sensors, GPS, and the truth for the firmware's log."""

from __future__ import annotations

import math

import numpy as np

from kernel.rotations import swap_attitude, swap_body
from vehicle.px4.codec import MESSAGES, Packer
from vehicle.px4.place import ORIGIN_ALTITUDE, geodetic
from vehicle.px4.sim.truth import Truth
from vehicle.quadrotor.airframe import GRAVITY

SYSTEM, COMPONENT = 245, 51  # of the simulator; PX4 does not look at them

# HIL_SENSOR.fields_updated, as PX4 reads it: a sensor counts only with all its bits.
IMU, MAG, BARO = 0b111_111, 0b111_000_000, 0b1_101_000_000_000
UTC_US = 1_767_225_600_000_000  # the firmware's time 0: 2026-01-01, in every run
_GPS_FIX, _SATELLITES = 3, 16
_EPH_CM, _EPV_CM = 10, 10


def hil_sensor(packer: Packer, time_us: int, reading: np.ndarray, fields: int) -> bytes:
    """HIL_SENSOR of the first IMU, whose time sets the firmware's clock in lockstep. `reading`: hitl.rows."""
    return packer.pack(MESSAGES["HIL_SENSOR"], time_us, *reading.tolist(), fields, 0)


def hil_gps(packer: Packer, time_us: int, fix: np.ndarray) -> bytes:
    """HIL_GPS of a place and velocity in the world (6,), m and m/s ENU. Its time is UTC, by which PX4 names its log
    (else it takes the computer's)."""
    x, y, z, vx, vy, vz = fix.tolist()
    latitude, longitude = geodetic(x, y)
    course = round(math.degrees(math.atan2(vx, vy)) * 100.0) % 36000
    speed, north, east, down = (round(v * 100.0) for v in (math.hypot(vx, vy, vz), vy, vx, -vz))
    return packer.pack(
        MESSAGES["HIL_GPS"], UTC_US + time_us, _GPS_FIX, latitude, longitude, round((ORIGIN_ALTITUDE + z) * 1000.0),
        _EPH_CM, _EPV_CM, speed, north, east, down, course, _SATELLITES, 0, 0,
    )  # fmt: skip


def hil_state(packer: Packer, time_us: int, truth: Truth, force: tuple[float, float, float]) -> bytes:
    """HIL_STATE_QUATERNION: the true state, which the firmware writes into its flight log. `force`: specific, m/s^2."""
    x, y, z = truth.position
    vx, vy, vz = truth.velocity
    latitude, longitude = geodetic(x, y)
    velocity = tuple(_int16(v * 100.0) for v in (vy, vx, -vz))
    milligravity = tuple(_int16(f * 1000.0 / GRAVITY) for f in swap_body(*force))
    return packer.pack(
        MESSAGES["HIL_STATE_QUATERNION"], time_us, swap_attitude(truth.orientation), *swap_body(*truth.body_rate),
        latitude, longitude, round((ORIGIN_ALTITUDE + z) * 1000.0), *velocity, 0, 0, *milligravity,
    )  # fmt: skip


def _int16(value: float) -> int:
    return round(min(32767.0, max(-32768.0, value)))
