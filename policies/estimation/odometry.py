"""The vehicle's own estimate, predicted from its stamp to now: it is a control tick old when a policy reads it.

In a flare the vehicle brakes at 10 m/s^2 and turns at 3 rad/s: 10 ms are 0.1 m/s and 2 deg. A plan that starts with
that error ends centimetres behind a moving board.
"""

from __future__ import annotations

import numpy as np

from kernel.jit import njit
from kernel.rotations import body_z, from_rotation_vector, multiply
from policies.estimation import odometry_row
from policies.task.interface import VehicleView
from vehicle.quadrotor.airframe import GRAVITY


@njit
def vehicle_now(age, p, v, q, w, thrust, drag, out):
    """Position, velocity (world) and orientation (wxyz, world from body) `age` s after the estimate, into `out` (10,).

    `p`, `v`, `w` (3,), `q` (4,): the estimate, with body rate `w` rad/s (FLU); `thrust`: that of the motors since
    then, m/s^2 along the body z axis; `drag` 1/s. Both are held over `age`.
    """
    turn = from_rotation_vector(age * w[0], age * w[1], age * w[2])
    turned = multiply((q[0], q[1], q[2], q[3]), turn)
    half = from_rotation_vector(0.5 * age * w[0], 0.5 * age * w[1], 0.5 * age * w[2])
    zx, zy, zz = body_z(multiply((q[0], q[1], q[2], q[3]), half))
    for i in range(3):
        z = zx if i == 0 else (zy if i == 1 else zz)
        a = thrust * z - drag * v[i] - (GRAVITY if i == 2 else 0.0)
        out[odometry_row.P + i] = p[i] + age * (v[i] + 0.5 * age * a)
        out[odometry_row.V + i] = v[i] + age * a
    for i in range(4):
        out[odometry_row.Q + i] = turned[i]


def odometry_now(
    now_ns: int, vehicle: VehicleView, thrust: float, drag: float, row: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(position, velocity, orientation) of `vehicle` at `now_ns`: views of an odometry row. See `vehicle_now`."""
    age = (now_ns - vehicle.stamp_ns) * 1e-9
    vehicle_now(age, vehicle.position, vehicle.velocity, vehicle.orientation, vehicle.body_rate, thrust, drag, row)
    return (
        row[odometry_row.P : odometry_row.V],
        row[odometry_row.V : odometry_row.Q],
        row[odometry_row.Q : odometry_row.DIM],
    )
