"""The settings of Fast-Perching, and the row that its kernels take."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from policies.planner.row_index import row_index
from vehicle.quadrotor.airframe import GRAVITY


@dataclass(frozen=True)
class FastPerchingParams:
    """Limits and geometry. The defaults are those of the published launch file, except gravity."""

    thrust_min: float  # m/s^2, least collective thrust
    thrust_max: float  # m/s^2, largest collective thrust
    contact_below: float  # m, contact disc below the centre of mass
    contact_radius: float  # m, of the contact disc
    speed_max: float = 6.0  # m/s
    rate_max: float = 3.0  # rad/s, of the body
    board_radius: float = 1.0  # m, of the disc that stands for the board
    closing: float = 0.3  # m/s into the board at contact
    floor: float = 0.4  # m, least height over the ground
    gravity: float = GRAVITY  # m/s^2

    def row(self) -> np.ndarray:
        """The settings row for kernels, in the order of the fields; AT has their places."""
        return np.array(astuple(self), dtype=np.float64)


AT = row_index(FastPerchingParams)
