"""Where a simulated PX4 is on Earth: its local frame as latitude and longitude, air pressure, magnetic field.

One place for all simulated vehicles (PX4's default of SIH_LOC_*), so that their clients see one home.
"""

from __future__ import annotations

import math

from kernel.jit import njit

EARTH_RADIUS = 6371000.0  # m, as PX4's local projection uses
ORIGIN_LATITUDE, ORIGIN_LONGITUDE, ORIGIN_ALTITUDE = 47.397742225, 8.545594135, 489.4  # SIH_LOC_*

# PX4's atmosphere, whose inverse its estimator applies to the barometer.
SEA_LEVEL_PA, SEA_LEVEL_K, LAPSE = 101325.0, 288.15, -0.0065  # Pa, K, K/m
_EXPONENT = -9.80665 / (LAPSE * 287.1)

# PX4's magnetic model at the origin: it compares strength and inclination of what it measures with it.
DECLINATION, INCLINATION = math.radians(3.406), math.radians(63.915)
FIELD = 0.4897  # gauss
FIELD_NED = (
    FIELD * math.cos(INCLINATION) * math.cos(DECLINATION),
    FIELD * math.cos(INCLINATION) * math.sin(DECLINATION),
    FIELD * math.sin(INCLINATION),
)


def geodetic(east: float, north: float) -> tuple[int, int]:
    """Latitude and longitude in 1e-7 deg of a place `east`, `north` (m) of the origin, within the wire's 32 bits."""
    latitude = ORIGIN_LATITUDE + math.degrees(north / EARTH_RADIUS)
    scale = EARTH_RADIUS * math.cos(math.radians(ORIGIN_LATITUDE))
    longitude = ORIGIN_LONGITUDE + math.degrees(east / scale)
    return _int32(latitude * 1e7), _int32(longitude * 1e7)


def _int32(value: float) -> int:
    return max(-(2**31), min(2**31 - 1, round(value)))


def local(latitude: float, longitude: float) -> tuple[float, float]:
    """East and north (m) of the origin, of a latitude and a longitude in deg."""
    scale = EARTH_RADIUS * math.cos(math.radians(ORIGIN_LATITUDE))
    return math.radians(longitude - ORIGIN_LONGITUDE) * scale, math.radians(latitude - ORIGIN_LATITUDE) * EARTH_RADIUS


@njit
def air_pressure(altitude):
    """Pressure (Pa) at `altitude` (m above sea level) in PX4's standard atmosphere."""
    return SEA_LEVEL_PA * (1.0 + LAPSE * altitude / SEA_LEVEL_K) ** _EXPONENT
