"""What can be set about the expert, as a dataclass and as the row that kernels take, and what its own row holds."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from policies.planner import polynomial as poly

# Indices of an expert row.
X_READY, X_BEGUN, X_MIDDLE, X_CONTACT, X_NEXT, X_COST = 0, 1, 2, 3, 4, 5
AXIS = poly.COEFFICIENTS
MOTION = 3 * AXIS  # numbers of a motion in three axes
X_FIRST, X_SECOND = 6, 6 + MOTION
X_TRY1, X_TRY2 = 6 + 2 * MOTION, 6 + 3 * MOTION
X_START, X_TARGET, X_BOARD = 6 + 4 * MOTION, 15 + 4 * MOTION, 24 + 4 * MOTION
EXPERT_DIM = 32 + 4 * MOTION

(E_IMPACT, E_THRUST_FLAT, E_THRUST_STEEP, E_MOVE_FLAT, E_MOVE_STEEP, E_EASE, E_REPLAN, E_FREEZE, E_FADE,
 E_RATE_LAG, E_THRUST_LAG, E_LOW, E_HIGH, E_RATE, E_W_TIME, E_W_POSTPONE, E_W_THRUST, E_W_RATE, E_W_CLEARANCE,
 E_W_SPEED, E_SPEED, E_GIVE_UP, E_OVERDUE, E_AIM, E_MISS, E_W_SMOOTH, E_LOCAL, E_FLATTEN, E_W_VIEW,
 E_BLIND, E_GLIDE, E_RATE_FLAT) = range(32)  # fmt: skip


@dataclass(frozen=True)
class ExpertParams:
    """How the expert perches. SI units, rad.

    `impact`: speed into the board. Thrust at contact: `thrust_flat` (of gravity's part along the normal), but at least
    `thrust_steep` m/s^2. Length of the last move: from `move_flat` s on a flat board to `move_steep` on a vertical one;
    `ease` 0..1 takes that share of the body rate at contact away. `replan` s; no plan is made in the last `freeze` s;
    position feedback fades out over the last `fade` s. `rate_lag`, `thrust_lag`: feed-forward ahead. Limits: `low` to
    `high` thrust asked, and `rate`, but less over boards below 30 deg, down to `rate_flat`: what could not turn any
    faster is not aligned in time where a flat board bends away. Within `aim` s of contact the plan need not end on the
    centre, by up to `miss` m. `w_*` weights of the cost. Within `local` s the plan under way is kept up, unless its
    cost is above `give_up` or it is `overdue` s late; `flatten` as `ease`, for what is planned then.
    `glide`: speed at which the last move begins to close in from behind, on a flat board, so that the camera keeps it.
    `w_view`: cost of a second with the board out of the camera's view, but not in the last `blind` s.
    """

    impact: float = 0.42
    thrust_flat: float = 0.9
    thrust_steep: float = 11.6
    move_flat: float = 0.4
    move_steep: float = 0.455
    ease: float = 0.86
    replan: float = 0.05
    freeze: float = 0.2
    fade: float = 0.22
    rate_lag: float = 0.031
    thrust_lag: float = 0.05
    low: float = 4.72
    high: float = 14.0
    rate: float = 3.0
    w_time: float = 4.9
    w_postpone: float = 2.8
    w_thrust: float = 2.8
    w_rate: float = 1.5
    w_clearance: float = 1000.0
    w_speed: float = 2.0
    speed: float = 5.0
    give_up: float = 140.0
    overdue: float = 0.19
    aim: float = 0.73
    miss: float = 0.1
    w_smooth: float = 0.09
    local: float = 0.79
    flatten: float = 0.12
    w_view: float = 6.0
    blind: float = 0.5
    glide: float = 0.5
    rate_flat: float = 2.3

    def row(self) -> np.ndarray:
        """The row for kernels."""
        return np.array(astuple(self), dtype=np.float64)
