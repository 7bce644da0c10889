"""The vehicle's own estimate at a control tick: its odometry predicted to now, its thrust gain and its drag."""

from __future__ import annotations

import numpy as np

from kernel.jit import njit
from kernel.rotations import body_z
from policies.estimation import odometry_row, thrust_row
from policies.estimation.odometry import vehicle_now
from policies.estimation.thrust_drag import gain_reset, gain_update
from policies.task.interface import VehicleView
from vehicle.quadrotor.airframe import GRAVITY, Airframe

WAIT = 0.01  # s from a command to its arrival at the motors


@njit
def _update(age, p, v, q, w, asked, dt, lag, drag, row, now):
    """One control tick of the thrust row `row`, and the odometry `age` s later into `now` (odometry_row). Returns the
    gain. Other arguments as of `vehicle_now` and `gain_update`."""
    vehicle_now(age, p, v, q, w, row[thrust_row.GAIN] * row[thrust_row.LAGGED], row[thrust_row.DRAG], now)
    vx, vy, vz = now[odometry_row.V], now[odometry_row.V + 1], now[odometry_row.V + 2]
    zx, zy, zz = body_z(now[odometry_row.Q : odometry_row.DIM])
    return gain_update(row, vx, vy, vz, zx, zy, zz, asked, dt, lag, drag, GRAVITY)


class OwnState:
    """The predicted odometry and the estimates of thrust gain and drag, from odometry and the commands flown.

    `position` m, `velocity` m/s (3,) world and `orientation` (4,) world from body: views, overwritten by `update`.
    `gain`: achieved over asked thrust; `drag` 1/s.
    """

    def __init__(self, airframe: Airframe) -> None:
        self._drag = sum(airframe.body.drag[:2]) / 2 / airframe.body.mass
        self._lag = airframe.motors.lag + WAIT
        self._row, now = np.zeros(thrust_row.DIM), np.zeros(odometry_row.DIM)
        self.position = now[odometry_row.P : odometry_row.V]
        self.velocity = now[odometry_row.V : odometry_row.Q]
        self.orientation = now[odometry_row.Q : odometry_row.DIM]
        self._now = now
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Forget the estimates; `now_ns` starts the clock."""
        gain_reset(self._row, GRAVITY)
        self._last_ns = now_ns

    def update(self, now_ns: int, vehicle: VehicleView, asked: float) -> None:
        """One control tick. `asked` m/s^2: the thrust flown since the last call."""
        age, dt = (now_ns - vehicle.stamp_ns) * 1e-9, (now_ns - self._last_ns) * 1e-9
        self.gain = _update(
            age, vehicle.position, vehicle.velocity, vehicle.orientation, vehicle.body_rate, asked, dt, self._lag,
            self._drag, self._row, self._now,
        )  # fmt: skip
        self.drag, self._last_ns = self._row[thrust_row.DRAG], now_ns
