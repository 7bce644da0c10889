"""Where a simulated vehicle really is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vehicle.quadrotor import state_row

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


class Truth(NamedTuple):
    """World ENU, body FLU, quaternion world from body; m, m/s, rad/s."""

    position: Vec3
    velocity: Vec3
    orientation: Quat
    body_rate: Vec3
    motors: tuple[float, float, float, float]  # thrust over full thrust
    armed: bool
    attached: bool


def truth_of(row: np.ndarray, armed: bool, attached: bool) -> Truth:
    """The truth of a state row."""
    v = row.tolist()
    p, q, w, m = state_row.P, state_row.Q, state_row.W, state_row.MOTOR
    velocity = (v[state_row.V], v[state_row.V + 1], v[state_row.V + 2])
    orientation = (v[q], v[q + 1], v[q + 2], v[q + 3])
    motors = (v[m], v[m + 1], v[m + 2], v[m + 3])
    return Truth((v[p], v[p + 1], v[p + 2]), velocity, orientation, (v[w], v[w + 1], v[w + 2]), motors, armed, attached)
