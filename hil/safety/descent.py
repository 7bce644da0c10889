"""How much height a descent still takes: a tilted vehicle first turns upright, and meanwhile falls. No clock, no I/O.

In 80 flights with pictures that perched or missed (six scenarios) a descent to the board ended at least 0.3 m above the
floor of the usual fence by this rule.
"""

from __future__ import annotations

import math

from hil.contract.messages import VehicleState
from kernel.rotations import body_z
from vehicle.quadrotor.airframe import GRAVITY

_BRAKING = 4.0  # m/s^2 upwards of an upright vehicle, with something left for its horizontal speed
_UPRIGHT = 0.3  # rad of tilt at which it brakes like that
_TURNING = 3.5  # rad/s
_FALLING = 0.5 * GRAVITY  # m/s^2 on average while it turns: from nearly no lift to its weight


def height_lost(vehicle: VehicleState) -> float:
    """Metres that `vehicle` sinks until its descent can have ended; 0 or less where it climbs by itself."""
    sinks = -vehicle.velocity[2]
    tilt = math.acos(max(-1.0, min(1.0, body_z(vehicle.orientation)[2])))
    turning = max(0.0, tilt - _UPRIGHT) / _TURNING
    then = max(0.0, sinks + _FALLING * turning)
    return sinks * turning + 0.5 * _FALLING * turning * turning + then * then / (2.0 * _BRAKING)
