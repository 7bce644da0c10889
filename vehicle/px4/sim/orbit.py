"""PX4's Orbit mode: a circle around a place, at a speed, with the nose as asked for."""

from __future__ import annotations

import math

import numpy as np

from kernel.rotations import yaw
from vehicle.px4.sim.rows import control
from vehicle.px4.sim.state import Flight

RADIUS_MIN, SPEED_MAX, ACCELERATION_MAX = 1.0, 10.0, 2.0  # m, m/s, m/s^2: PX4's limits
_ARRIVED = 1.0  # m from the circle: it is flown along
_CENTRE, _KEPT, _FREE, _TANGENT = range(4)  # ORBIT_YAW_BEHAVIOUR: nose to the centre, as it was, not told, along


class Orbit:
    """`start` with a command's parameters; `update` at the commander's rate while the mode runs."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self.centre = np.zeros(3)
        self.radius = RADIUS_MIN  # m; negative: counter-clockwise
        self._speed, self._nose, self._heading = 1.0, _CENTRE, 0.0

    def start(self, radius: float, speed: float, nose: float, place: tuple[float, float], height: float) -> None:
        """`place` (m, world) and `height` of the circle's centre; what is NaN stays as it is now: the place where the
        vehicle is, its height, 1 m/s, the nose of MC_ORBIT_YAW_MOD. A negative radius (m) is flown counter-clockwise,
        seen from above."""
        flight, p = self._flight, self._flight.parameters
        given = (*place, height)
        self.centre[:] = [here if math.isnan(one) else one for one, here in zip(given, flight.position, strict=True)]
        away = math.hypot(flight.position[0] - self.centre[0], flight.position[1] - self.centre[1])
        radius = away if math.isnan(radius) else radius
        size = min(float(p["MC_ORBIT_RAD_MAX"]), max(RADIUS_MIN, abs(radius)))
        self.radius = math.copysign(size, radius)
        most = min(SPEED_MAX, math.sqrt(ACCELERATION_MAX * size))
        self._speed = min(most, abs(speed)) if math.isfinite(speed) else min(most, 1.0)
        self._nose = int(nose) if math.isfinite(nose) else int(p["MC_ORBIT_YAW_MOD"])
        self._heading = yaw(flight.attitude)

    def update(self) -> None:
        """Refresh the set-points."""
        flight, c, p = self._flight, self._flight.control, self._flight.parameters
        if not flight.armed or flight.landed:
            c[control.MODE] = control.OFF
            return
        dx, dy = flight.position[0] - self.centre[0], flight.position[1] - self.centre[1]
        away = math.hypot(dx, dy)
        heading = yaw(flight.attitude)
        ux, uy = (dx / away, dy / away) if away > 0.1 else (-math.cos(heading), -math.sin(heading))
        turn = math.copysign(1.0, self.radius)  # 1: clockwise
        tx, ty = turn * uy, -turn * ux
        size = abs(self.radius)
        speed = self._speed if abs(away - size) < _ARRIVED else 0.0
        c[control.MODE], c[control.SMOOTH], c[control.RAMP] = control.POSITION, 1.0, math.inf
        c[control.MAX_XY], c[control.MAX_TILT] = p["MPC_XY_CRUISE"], math.radians(p["MPC_TILTMAX_AIR"])
        c[control.MAX_UP], c[control.MAX_DOWN] = p["MPC_Z_V_AUTO_UP"], p["MPC_Z_V_AUTO_DN"]
        c[control.POS_SP] = self.centre[0] + size * ux
        c[control.POS_SP + 1] = self.centre[1] + size * uy
        c[control.POS_SP + 2] = self.centre[2]
        c[control.VEL_SP : control.VEL_SP + 3] = speed * tx, speed * ty, 0.0
        pull = speed * speed / size
        c[control.ACC_SP : control.ACC_SP + 3] = -pull * ux, -pull * uy, math.nan
        self._point(math.atan2(-uy, -ux), math.atan2(ty, tx))

    def _point(self, inward: float, along: float) -> None:
        noses = {_CENTRE: inward, _KEPT: self._heading, _TANGENT: along}
        self._flight.control[control.YAW_SP] = noses.get(self._nose, math.nan)
        self._flight.control[control.YAW_RATE_SP] = math.nan
