"""The planner's parameters in groups: what each one means, its unit and its value for boards that take no run-up.

Angles are in rad. "Steep" and "flat" boards are the two ends between which a value is interpolated by the inclination.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from policies.estimation.ctrv import BeliefParams


@dataclass(frozen=True)
class Vehicle:
    """The airframe's properties and command limits. `policy.planner_params` fills them in, so there are no defaults."""

    drag: float  # 1/s, linear drag over mass, expected until the flight shows another
    thrust_min: float  # m/s^2, least collective thrust that may be commanded
    thrust_max: float  # m/s^2, largest collective thrust that may be commanded
    rate_max: float  # rad/s, largest body rate that may be commanded about each axis
    thrust_lag: float  # s, first-order lag of the motors
    camera_tilt: float  # rad, of the camera's axis below body x
    contact_below: float  # m, the contact disc below the centre of mass (paper: l)
    contact_radius: float  # m, of the contact disc (paper: r)


@dataclass(frozen=True)
class Contact:
    """The state in which a planned motion ends."""

    speed: float = 0.8  # m/s into the board along its normal
    speed_by_sigma: float = 10.0  # 1/s, speed added by the surface's sigma (m): an uncertain surface is met faster
    skid: float = 0.1  # m/s up the slope relative to the board; each search tries 0 and this
    overshoot: float = 0.0  # m behind the surface (negative: before it), so that a height error makes contact early
    overshoot_by_acceleration: float = 0.0  # s^2, overshoot added by the board's acceleration (m/s^2)
    lean: float = 0.06  # rad up the slope from normal to thrust at 30 deg and more: it offsets gravity along the board
    flatten: float = 1.0  # 0..1, share of the terminal jerk taken away on a flat board; none from 60 deg on
    aim: float = 0.0  # s before contact; with less than that left the end need not be the board's centre
    miss: float = 0.1  # m beside the centre at most, where `aim` lets the end drift


@dataclass(frozen=True)
class Terminal:
    """The last moment before contact, in which thrust is chosen by the contact that it leads to."""

    start: float = 0.3  # s before contact at which it begins
    speed: float = 0.58  # m/s into the board that is wanted
    speed_steep: float = 0.2  # m/s more on a vertical board: a slow approach gives gravity time to pull along it
    speed_band: float = 0.4  # m/s off the wanted speed that costs 1
    skid: float = 0.33  # m/s along the board that costs 1
    early: float = 0.02  # s before the planned contact that costs 1
    late: float = 0.04  # s after the planned contact that costs 1
    keep: float = 0.0015  # s^4/m^2, weight of the squared difference from the planned thrust
    lag: float = 0.02  # s during which the old thrust still acts
    sigmas: float = 3.0  # sigmas by which the surface is also tried nearer and farther, at half of the weight
    no_contact: float = 9.0  # cost of no contact with the surface there


@dataclass(frozen=True)
class Search:
    """Which motions are tried, when, and what they must keep to."""

    duration_min: float = 0.7  # s, shortest motion
    duration_max: float = 2.6  # s, longest motion
    thrust_min: float = 5.5  # m/s^2, least terminal thrust
    thrust_max: float = 12.0  # m/s^2, largest terminal thrust
    period: float = 0.05  # s between two plans
    freeze: float = 0.345  # s before contact from which the plan is kept
    freeze_flat: float = 0.48  # s, the same on a flat board, which is out of view by then
    speed_max: float = 5.0  # m/s, above which speed costs
    half_view: float = math.radians(24.0)  # rad, half of the vertical field of view in which the board shall be
    blind: float = 0.27  # s before contact from which the view costs nothing


@dataclass(frozen=True)
class Weights:
    """Weights of a motion's cost, which has no unit."""

    time: float = 0.9  # 1/s, of the duration
    postpone: float = 3.9  # 1/s, of contact later than in the plan under way
    thrust: float = 1.24  # s^3/m^2, of squared thrust beyond what the vehicle gives, over time
    rate: float = 3.0  # s, of squared body rate beyond its limit, over time
    clearance: float = 1000.0  # 1/(m^2 s), of squared missing clearance over ground and board, over time
    visibility: float = 1.25  # 1/s^2, of squared time with the board out of view
    speed: float = 1.0  # s/m^2, of squared speed above `Search.speed_max`, over time
    force: float = 0.07  # s^2/m, of the terminal thrust
    skid: float = 1.5  # s^2/m^2, of the squared terminal skid


@dataclass(frozen=True)
class Prediction:
    """How the board is predicted."""

    acceleration_tau: float = 0.8  # s, decay of the board's acceleration in the prediction
    filter_tau: float = BeliefParams.accel_tau  # s, the same decay in the belief filter
    trust: float = 1.0  # 0..1, share of the predictor network's speeds; the rest is the decaying acceleration


@dataclass(frozen=True)
class Commit:
    """When a perch is begun and when it is given up. Demands relax with the time since the planner engaged."""

    cost: float = 2.0  # a plan is begun below this cost over cos(inclination)
    abort_cost: float = 17.0  # a plan under way is given up above this cost
    sigma: float = 0.04  # m, one-sigma of the believed position that is allowed
    speed_sigma: float = 0.31  # m/s, one-sigma of the believed speed that is allowed
    age: float = 0.097  # s, age of the newest exposure that is allowed
    streak: float = 8.0  # accepted detections in a row that are demanded
    surprise: float = 0.07  # m/s, allowed rms error of the prediction of the newest speeds
    relax_after: float = 3.3  # s, in which what is allowed grows by its own size
    relax_surprise: float = 1.0  # share of that growth which counts for `surprise`
    lost_age: float = 0.94  # s without an exposure after which a plan is given up
    overdue: float = 0.08  # s after the planned contact at which it counts as missed
    climb: float = 0.6  # s of climbing away after a miss


@dataclass(frozen=True)
class Follow:
    """Keeping station behind and above the board before a perch. Values for a flat board, and for 60 deg and more."""

    distance: float = 2.9  # m from the board, steep
    distance_flat: float = 1.5  # m from the board, flat
    elevation: float = math.radians(18.5)  # rad above the board's horizon, steep
    elevation_flat: float = math.radians(29.3)  # rad above the board's horizon, flat
    kp: float = 1.45  # 1/s, position error to speed
    kv: float = 5.4  # 1/s, speed error to acceleration
    speed: float = 2.0  # m/s relative to the board at most
    tilt: float = math.radians(25.0)  # rad from the vertical at most
    yaw_k: float = 1.65  # 1/s, bearing error to yaw rate
    yaw_rate_max: float = 1.5  # rad/s
    yaw_near: float = 0.5  # m of horizontal distance below which yaw is left alone


@dataclass(frozen=True)
class Tracking:
    """Feedback about a planned motion, and the attitude loop under every phase."""

    fade: float = 0.36  # s before contact over which position feedback on the attitude ends
    kp: float = 8.6  # 1/s^2, position error to acceleration
    kv: float = 5.6  # 1/s, speed error to acceleration
    attitude_k: float = 12.0  # 1/s, attitude error to body rate
    rate_ahead: float = 0.058  # s by which the motion's attitude and body rate are fed forward: the rate loop's delay


@dataclass(frozen=True)
class RunUp:
    """The run-up: how a board too steep for its speed is approached. Defined in `runup.py`."""

    inclination: float = math.radians(62.0)  # rad, from which boards take a run-up
    inclination_slow: float = math.radians(6.0)  # rad more for a slow board
    thrust: float = 12.6  # m/s^2, constant thrust of the flare that it leads to
    rate: float = 3.24  # rad/s, constant body rate of that flare
    acceleration: float = 1.46  # m/s^2, towards the board
    coast: float = 0.2  # s at constant speed between acceleration and flare
    rise: float = 0.95  # m/s^2, vertical acceleration at most
    kp: float = 2.13  # 1/s^2, position error to acceleration
    kv: float = 3.89  # 1/s, speed error to acceleration
    pull: float = 0.8  # 1/s, distance from its start to speed towards it, `Follow.speed` at most
    away: float = 0.6  # m from its start within which it begins
    turn: float = 0.5  # rad/s of the board's turn below which it begins
    slow_share: float = 0.14  # 0..1, lowest share of the board's speed range in which contact shall be
    commit: float = 1.16  # s before the flare from which the perch is planned
    cost: float = 10.1  # such a plan is taken over below this cost


@dataclass(frozen=True)
class Glide:
    """The glide, which replaces plans over flat boards. Its law is in `glide.py`."""

    inclination: float = math.radians(12.0)  # rad, below which boards are approached so; 0: none
