"""How well the board is known, for the planner: filling an estimate row (estimate_row.DIM,)."""

from __future__ import annotations

import math

from kernel.jit import njit
from policies.estimation import belief_row, belief_state
from policies.estimation.board_ekf import belief_age, belief_covariance, belief_valid, surface_sigma
from policies.planner import estimate_row


@njit
def certain(estimate):
    """Fill an estimate row for a board that is known exactly."""
    (
        estimate[estimate_row.VALID],
        estimate[estimate_row.SIGMA],
        estimate[estimate_row.SPEED_SIGMA],
        estimate[estimate_row.AGE],
        estimate[estimate_row.STREAK],
    ) = 1, 0, 0, 0, 1e9
    estimate[estimate_row.SURPRISE], estimate[estimate_row.SURFACE] = 0, 0


@njit
def estimate_from_belief(row, t, params, x, p, estimate):
    """Fill `estimate` from a belief row at time `t`; `x` (8,) gets the state there, `p` (81,) its covariance."""
    belief_covariance(row, t, params, x, p)
    estimate[estimate_row.VALID] = 1.0 if belief_valid(row, t, params) else 0.0
    estimate[estimate_row.SIGMA] = math.sqrt(max(0.0, 0.5 * (p[0] + p[belief_state.DIM + 1])))
    estimate[estimate_row.SPEED_SIGMA] = math.sqrt(max(0.0, p[4 * (belief_state.DIM + 1)]))
    estimate[estimate_row.AGE] = belief_age(row, t)
    estimate[estimate_row.STREAK] = row[belief_row.STREAK]
    estimate[estimate_row.SURFACE] = surface_sigma(row)
