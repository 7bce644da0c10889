"""The expert's parameters, and their row for kernels."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from policies.environment.config import TICK
from policies.planner.row_index import row_index
from vehicle.quadrotor.airframe import Airframe

_PREDICTED, _AHEAD = 0.47, 0.515  # of the rate lag: found by search on sih_quad and paper_quad, as the defaults below
_GAP = 0.012  # m between the disc and the surface at the end of a plan: a height error then makes contact early


@dataclass(frozen=True)
class ExpertParams:
    """How the expert perches. Values for boards between flat and vertical go with the sine of the inclination.

    Those without a default come from the airframe, see `of`."""

    rate_lag: float  # s, lag of the body rate behind its set-point
    thrust_lag: float  # s, lag of the motors' thrust
    predicted: float  # s by which the vehicle is predicted: whole control steps
    ahead: float  # s by which attitude and body rate are fed forward beyond that
    low: float  # m/s^2, least thrust of a plan
    high: float  # m/s^2, largest thrust of a plan
    over: float  # m over the surface at the end of a plan
    impact: float = 0.43  # m/s into the board at contact
    thrust_flat: float = 0.8  # thrust at contact over gravity's part along the normal
    thrust_steep: float = 11.3  # m/s^2, thrust at contact at least
    move: float = 0.433  # s, length of the last move
    ease: float = 0.81  # 0..1, share of the body rate at contact that is taken away from the last move
    replan: float = 0.05  # s between two plans
    freeze: float = 0.235  # s before contact from which the plan is kept
    fade: float = 0.156  # s before contact over which position feedback ends
    rate: float = 2.7  # rad/s, body rate of a plan at most
    w_time: float = 5.1  # 1/s, weight of the time to contact
    w_postpone: float = 2.8  # 1/s, weight of contact later than in the plan before
    w_thrust: float = 2.8  # s^3/m^2, weight of squared thrust outside `low` to `high`, over time
    w_rate: float = 1.0  # s, weight of squared body rate above its limit, over time
    w_clearance: float = 800.0  # 1/(m^2 s), weight of squared missing clearance over ground and board, over time
    w_speed: float = 2.0  # s/m^2, weight of squared speed above `speed`, over time
    speed: float = 5.0  # m/s, above which speed costs
    give_up: float = 140.0  # cost above which the plan under way is dropped
    overdue: float = 0.19  # s after the planned contact at which the plan is dropped
    aim: float = 0.39  # s before contact; with less than that left the end need not be the board's centre
    miss: float = 0.1  # m beside the centre at most, where `aim` lets the end drift
    w_smooth: float = 0.09  # s, weight of the squared body rate, over time
    local: float = 0.63  # s before contact from which the plan under way is varied rather than replaced
    flatten: float = 0.06  # 0..1, share of the terminal jerk taken away from plans of that last time
    w_view: float = 6.0  # 1/s, weight of the time with the board out of view
    blind: float = 0.5  # s before contact from which the view costs nothing
    glide: float = 0.56  # m/s along a flat board at which the last move begins, from behind: the camera keeps the board

    @classmethod
    def of(cls, airframe: Airframe, **changes: float) -> ExpertParams:
        """The parameters for an airframe, with `changes` of them."""
        lag = airframe.command.rate_lag
        vehicle = {
            "rate_lag": lag,
            "thrust_lag": airframe.motors.lag,
            "predicted": max(1, round(_PREDICTED * lag / TICK)) * TICK,
            "ahead": _AHEAD * lag,
            "low": airframe.command.thrust[0],
            "high": airframe.command.thrust[1],
            "over": airframe.contact.magnet_below + _GAP,
        }
        return cls(**{**vehicle, **changes})

    def row(self) -> np.ndarray:
        """The row for kernels, in the order of the fields; AT holds their indices."""
        return np.array(astuple(self), dtype=np.float64)


AT = row_index(ExpertParams)
