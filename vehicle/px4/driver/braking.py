"""The quickest stop by body rates and thrust, from the autopilot's own estimate.

PX4's velocity controller turns to its tilt more slowly, and tilts less: too late for a vehicle that dives at a board.
Here the net acceleration points against the velocity and is as large as the thrust gives beside the weight. Its
attitude is turned to at the largest rate by the shortest way; yaw is left as it is.
"""

from __future__ import annotations

import math

from kernel.clip import usable
from kernel.rotations import body_z, rotate_back
from vehicle.px4.driver.send import GRAVITY
from vehicle.px4.driver.types import Odometry, Rates

BRAKE_NS = 10_000_000  # between set-points that brake
_FRESH_NS = 100_000_000  # age of odometry that it brakes by
_THRUST = 0.8  # of all thrust: the body rates need the rest
_RATE = 3.5  # rad/s; PX4 itself takes 3.8 (MC_ROLLRATE_MAX)
_GAIN = 10.0  # 1/s, of body rate over the angle that is left
_FADE_S = 0.25  # the acceleration is at most the speed over this, so that the vehicle is level when it stands
_IDLE = 0.3  # of the thrust, while its axis points the wrong way


def braking_rates(now_ns: int, odometry: Odometry | None, hover_thrust: float) -> Rates | None:
    """Body rates and thrust that stop the vehicle, level at its weight once it stands; None without usable odometry.

    `hover_thrust`: normalised, 0..1. A vehicle that can hardly lift itself brakes as far as it can.
    """
    if odometry is None or now_ns - odometry.stamp_ns > _FRESH_NS:
        return None
    velocity, q = odometry.velocity, odometry.orientation
    if not usable((*velocity, *q)):
        return None
    most_thrust = _THRUST * GRAVITY / hover_thrust
    speed = math.hypot(*velocity)
    x, y, z = (-v / speed for v in velocity) if speed > 1e-6 else (0.0, 0.0, 0.0)
    lift = z * GRAVITY
    # |k (x, y, z) + (0, 0, GRAVITY)| = most_thrust, solved for k
    most = math.sqrt(max(0.0, lift * lift + most_thrust * most_thrust - GRAVITY * GRAVITY)) - lift
    k = min(max(0.0, most), speed / _FADE_S)
    wanted = (k * x, k * y, k * z + GRAVITY)
    thrust = math.hypot(*wanted)
    along = sum(a * b for a, b in zip(wanted, body_z(q), strict=True))
    bx, by, bz = rotate_back(q, *wanted)
    across = math.hypot(bx, by)
    rate = min(_RATE, _GAIN * math.atan2(across, bz))
    roll, pitch = (-by / across * rate, bx / across * rate) if across > 1e-6 else (0.0, 0.0)
    return Rates((roll, pitch, 0.0), thrust if along > 0.0 else _IDLE * thrust)
