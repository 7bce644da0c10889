"""The belief for flight: detections with exposure times (ns) in, the board predicted to now out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kernel.clip import usable
from kernel.jit import njit
from kernel.stamps import later_than_now
from policies.estimation import belief_row, belief_state, measured_row
from policies.estimation.board_ekf import (
    ACCEPTED,
    CODES,
    IMPLAUSIBLE,
    LATER_THAN_NOW,
    RESTARTED,
    belief_covariance,
    belief_predict,
    belief_reset,
    belief_update,
    belief_valid,
    measurement_from_pose,
    surface_sigma,
)
from policies.estimation.ctrv import BeliefParams


class BoardEstimate(NamedTuple):
    """Output of `BoardFilter`: the board predicted to `stamp_ns`."""

    stamp_ns: int
    valid: bool
    position: tuple[float, float, float]
    heading: float
    speed: float
    turn_rate: float
    inclination: float
    rho: float
    last_exposure_ns: int
    accepted: int
    rejected: int
    variance: tuple[float, ...]  # of the state, in its order, predicted to stamp_ns
    acceleration: float  # m/s^2, along the heading
    streak: int  # measurements accepted since the last (re)start
    surface_sigma: float  # m, of the board's surface along its normal at the newest exposure


@njit
def _estimate(row, t, params, out, x, p):
    """All of an estimate at time `t` (s) in one call: fills `out`, `x` and `p`, returns (rho, valid, surface sigma)."""
    rho = belief_predict(row, t, params, out)
    belief_covariance(row, t, params, x, p)
    return rho, belief_valid(row, t, params), surface_sigma(row)


class BoardFilter:
    """The filter for flight: times in ns, `BoardEstimate` out; `row` is a belief row, read by the planner."""

    def __init__(self, params: BeliefParams | None = None) -> None:
        self.params = (params or BeliefParams()).row()
        self.row = np.zeros(belief_row.DIM)
        self._z, self._r = np.zeros(measured_row.DIM), np.zeros(measured_row.DIM)
        self._x, self._out = np.zeros(belief_state.PREDICTED_DIM), np.zeros(belief_state.PREDICTED_DIM)
        self._p = np.zeros(belief_state.DIM * belief_state.DIM)
        self._origin_ns = self._exposure_ns = 0

    def reset(self) -> None:
        """Return to the state before the first measurement, counts included."""
        belief_reset(self.row)
        self._exposure_ns = 0

    def seconds(self, stamp_ns: int) -> float:
        """`stamp_ns` on the row's time axis."""
        return (stamp_ns - self._origin_ns) * 1e-9

    def update(
        self,
        exposure_ns: int,
        position: tuple[float, float, float],
        quaternion: tuple[float, float, float, float],
        position_sigma: float | tuple[float, float, float],
        orientation_sigma: float,
        now_ns: int | None = None,
    ) -> str:
        """Feed a detection (world ENU; quaternion wxyz, world from board); returns one of `CODES`.

        `position_sigma` is one number or one for each world axis, m; `orientation_sigma` rad. `now_ns`: the time of
        arrival. An exposure later than that is refused, as it would have all later ones refused as out of order.
        """
        if now_ns is not None and later_than_now(exposure_ns, now_ns):
            self.row[belief_row.REJECTED] += 1.0
            return CODES[LATER_THAN_NOW]
        if self.row[belief_row.STREAK] == 0.0:
            self._origin_ns = exposure_ns
        sigma = np.array(position_sigma, dtype=np.float64) * np.ones(3)
        p, q = np.array(position, dtype=np.float64), np.array(quaternion, dtype=np.float64)
        sane = measurement_from_pose(p, q, sigma, orientation_sigma, self._z, self._r)
        finite = np.isfinite(self._z).all() and np.isfinite(self._r).all()
        if finite and not (sane and usable(self._z) and usable(self._r)):
            self.row[belief_row.REJECTED] += 1.0
            return CODES[IMPLAUSIBLE]
        code = belief_update(self.row, self.seconds(exposure_ns), self._z, self._r, self.params)
        if code in (ACCEPTED, RESTARTED):
            self._exposure_ns = exposure_ns
        return CODES[code]

    def estimate(self, now_ns: int) -> BoardEstimate:
        """The board predicted to `now_ns`."""
        rho, valid, sigma = _estimate(self.row, self.seconds(now_ns), self.params, self._out, self._x, self._p)
        x, y, z, heading, speed, turn, inclination, _ = self._out.tolist()
        return BoardEstimate(
            now_ns,
            valid,
            (x, y, z),
            heading,
            speed,
            turn,
            inclination,
            rho,
            self._exposure_ns,
            int(self.row[belief_row.ACCEPTED]),
            int(self.row[belief_row.REJECTED]),
            tuple(self._p[:: belief_state.DIM + 1].tolist()),
            float(self._x[belief_state.ACCELERATION]),
            int(self.row[belief_row.STREAK]),
            sigma,
        )
