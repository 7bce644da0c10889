"""The vehicle's own estimate at a control tick: its odometry predicted to now, its thrust gain and its drag."""

from __future__ import annotations

import numpy as np

from kernel.rotations import body_z
from policies.estimation import odometry_row, thrust_row
from policies.estimation.odometry import odometry_now
from policies.estimation.thrust_drag import gain_reset, gain_update
from policies.task.interface import VehicleView
from vehicle.quadrotor.airframe import GRAVITY, Airframe

WAIT = 0.01  # s from a command to its arrival at the motors


class OwnState:
    """The predicted odometry and the estimates of thrust gain and drag, from odometry and the commands flown.

    `position` m, `velocity` m/s (3,) world and `orientation` (4,) world from body: views, overwritten by `update`.
    `gain`: achieved over asked thrust; `drag` 1/s.
    """

    def __init__(self, airframe: Airframe) -> None:
        self._drag = sum(airframe.body.drag[:2]) / 2 / airframe.body.mass
        self._lag = airframe.motors.lag + WAIT
        self._row, self._now = np.zeros(thrust_row.DIM), np.zeros(odometry_row.DIM)
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Forget the estimates; `now_ns` starts the clock."""
        gain_reset(self._row, GRAVITY)
        self._last_ns = now_ns

    def update(self, now_ns: int, vehicle: VehicleView, asked: float) -> None:
        """One control tick. `asked` m/s^2: the thrust flown since the last call."""
        row = self._row
        now = odometry_now(
            now_ns, vehicle, row[thrust_row.GAIN] * row[thrust_row.LAGGED], row[thrust_row.DRAG], self._now
        )
        self.position, self.velocity, self.orientation = now
        axis, dt = body_z(self.orientation), (now_ns - self._last_ns) * 1e-9
        self.gain = gain_update(row, *self.velocity, *axis, asked, dt, self._lag, self._drag, GRAVITY)
        self.drag, self._last_ns = row[thrust_row.DRAG], now_ns
