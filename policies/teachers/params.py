"""The expert's parameters, and their row for kernels."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from policies.planner.row_index import row_index


@dataclass(frozen=True)
class ExpertParams:
    """How the expert perches. Values for boards between flat and vertical go with the sine of the inclination."""

    impact: float = 0.42  # m/s into the board at contact
    thrust_flat: float = 0.9  # thrust at contact over gravity's part along the normal
    thrust_steep: float = 11.6  # m/s^2, thrust at contact at least
    move_flat: float = 0.4  # s, length of the last move on a flat board
    move_steep: float = 0.455  # s, length of the last move on a vertical board
    ease: float = 0.86  # 0..1, share of the body rate at contact that is taken away from the last move
    replan: float = 0.05  # s between two plans
    freeze: float = 0.2  # s before contact from which the plan is kept
    fade: float = 0.22  # s before contact over which position feedback ends
    rate_lag: float = 0.031  # s by which attitude and body rate are fed forward
    thrust_lag: float = 0.05  # s by which thrust is fed forward
    low: float = 4.72  # m/s^2, least thrust of a plan
    high: float = 14.0  # m/s^2, largest thrust of a plan
    rate: float = 3.0  # rad/s, body rate of a plan at most, over boards of 30 deg and more
    w_time: float = 4.9  # 1/s, weight of the time to contact
    w_postpone: float = 2.8  # 1/s, weight of contact later than in the plan before
    w_thrust: float = 2.8  # s^3/m^2, weight of squared thrust outside `low` to `high`, over time
    w_rate: float = 1.5  # s, weight of squared body rate above its limit, over time
    w_clearance: float = 1000.0  # 1/(m^2 s), weight of squared missing clearance over ground and board, over time
    w_speed: float = 2.0  # s/m^2, weight of squared speed above `speed`, over time
    speed: float = 5.0  # m/s, above which speed costs
    give_up: float = 140.0  # cost above which the plan under way is dropped
    overdue: float = 0.19  # s after the planned contact at which the plan is dropped
    aim: float = 0.73  # s before contact; with less than that left the end need not be the board's centre
    miss: float = 0.1  # m beside the centre at most, where `aim` lets the end drift
    w_smooth: float = 0.09  # s, weight of the squared body rate, over time
    local: float = 0.79  # s before contact from which the plan under way is varied rather than replaced
    flatten: float = 0.12  # 0..1, share of the terminal jerk taken away from plans of that last time
    w_view: float = 6.0  # 1/s, weight of the time with the board out of view
    blind: float = 0.5  # s before contact from which the view costs nothing
    glide: float = 0.5  # m/s along a flat board at which the last move begins, from behind: the camera keeps the board
    rate_flat: float = (
        2.3  # rad/s, `rate` over a flat board: a faster turn is not aligned in time where the board turns
    )

    def row(self) -> np.ndarray:
        """The row for kernels, in the order of the fields; AT holds their indices."""
        return np.array(astuple(self), dtype=np.float64)


AT = row_index(ExpertParams)
