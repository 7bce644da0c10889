"""What can be set about the planner, as a checked dataclass and as the row that kernels take."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from policies.estimation.ctrv import BeliefParams

(
    GRAVITY, DRAG, THRUST_MIN, THRUST_MAX, RATE_MAX, RATE_LAG, THRUST_LAG, CAMERA_TILT, CAMERA_HALF_FOV, ROBOT_L,
    ROBOT_R, IMPACT_SPEED, OVERSHOOT, FLATTEN, T_MIN, T_MAX, F_MIN, F_MAX, REPLAN, FREEZE, BLIND, W_TIME, W_POSTPONE,
    W_THRUST, W_RATE, W_CLEARANCE, W_VIEW, W_SPEED, W_FORCE, W_SKID, SKID, PREDICT_TAU, FILTER_TAU, RELAX_SURPRISE,
    COMMIT_SURPRISE, RUN_INCLINATION, RUN_THRUST, RUN_RATE, RUN_ACCEL, RUN_COAST, RUN_RISE, RUN_KP, RUN_KV, RUN_AWAY,
    RUN_TURN, RUN_COMMIT, RUN_COST, SPEED_MAX, COMMIT_COST, ABORT_COST, COMMIT_SIGMA, COMMIT_SPEED_SIGMA, COMMIT_AGE,
    COMMIT_STREAK, RELAX_AFTER, LOST_AGE, MISS_AFTER, AROUND_TIME, STANDOFF, STANDOFF_FLAT, ELEVATION, ELEVATION_FLAT,
    FOLLOW_KP, FOLLOW_KV, FOLLOW_SPEED, FOLLOW_TILT, FADE, TRACK_KP, TRACK_KV, ATTITUDE_K, YAW_K, YAW_RATE_MAX,
    YAW_NEAR, TOUCH_FROM, TOUCH_SPEED, TOUCH_BAND, TOUCH_SKID, TOUCH_EARLY, TOUCH_LATE, TOUCH_KEEP,
    TOUCH_LAG, RUN_SWING, OVERSHOOT_SWING, AIM, MISS, PREDICT_TRUST, FREEZE_FLAT, LEAN, TOUCH_STEEP,
    TOUCH_LEAN, GLIDE_INCLINATION, RUN_SLOW, TOUCH_UNSURE, TOUCH_MISS, IMPACT_UNSURE,
    RUN_PULL,
) = range(96)  # fmt: skip
COUNT = 96

STEEP: dict[str, float] = {
    "f_max": 17.8,
    "fade": 0.2,
    "track_kp": 3.8,
    "track_kv": 9.4,
    "commit_surprise": 0.15,
    "relax_surprise": 0.3,
    "w_force": 0.03,
    "follow_tilt": 1.06,
    "freeze": 0.278,
    "w_rate": 10.6,
    "impact_speed": 0.85,
    "w_thrust": 2.8,
    "follow_speed": 3.2,
    "w_postpone": 10.6,
    "replan": 0.025,
    "w_time": 0.64,
    "predict_tau": 0.8,
    "w_view": 0.64,
    "relax_after": 3.46,
    "skid": 0.0,
    "flatten": 0.0,
    "overshoot": -0.012,
    "overshoot_swing": 0.035,
    "aim": 0.7,
    "predict_trust": 0.6,
    "blind": 0.52,
    "follow_kv": 6.0,
    "t_min": 0.64,
    "yaw_k": 2.5,
    "standoff": 2.4,
    "commit_speed_sigma": 0.25,
    "commit_age": 0.15,
    "lost_age": 1.05,
    "elevation": 0.244,
    "run_coast": 0.35,
    "touch_speed": 0.65,
    "impact_unsure": 0.0,
}


@dataclass(frozen=True)
class PlannerParams:
    """Limits, weights and rules of the planner. SI units, rad.

    Vehicle: `drag` 1/s, expected until flight shows it;
    `thrust_*`, `rate_max` limits of what may be asked (paper App. "Experimental Setup");
    `rate_lag`, `thrust_lag` how far ahead rate and thrust are fed forward; camera tilt below body x and half field of
    view, vertical; `robot_l`, `robot_r` the disc of the contact criterion.
    Contact: `impact_speed` into the board along its normal (and `impact_unsure` 1/s times the surface's sigma more, off
    run-ups: faster is less long under way when the surface is not where it is believed to be) and `skid` up its slope
    (tried beside 0) are planned. The plan ends `overshoot` behind the surface, so that a small error along the normal
    makes contact early rather than never (negative: before it). A board whose speed changes is foretold worse, and late
    is worse than early where gravity pulls along the slope: `overshoot_swing` (s^2) times its acceleration comes on
    top. At contact thrust leans up the slope from the normal by `lean` rad (on boards of 30 deg and more; less on
    flatter ones): that takes something off gravity's pull along the board, and with it off the skid of a contact too
    early or too late, for a share of the tolerance in angle (negative: down the slope). `flatten` 0..1: on a flat board
    this share of the terminal jerk (and with it of the last body rate) is taken away, from 60 deg on none. Less than
    `aim` s before contact a motion may end up to `miss` m beside the centre. In the last `touch_from` s thrust is
    chosen for the contact that it leads to: speed into the board `touch_speed` (and `touch_steep` more on a vertical
    one, where what comes slowly has time to be pulled along) within `touch_band`, speed along it within `touch_skid`,
    no more than `touch_early` or `touch_late` s off the plan. Half of that is judged with the surface where it is
    believed to be, half with it `touch_unsure` of its sigmas nearer and farther, where not to touch at all costs
    `touch_miss`. `touch_keep` weighs the change of thrust, which comes `touch_lag` s late. Rates then see to an aligned
    contact, body z `touch_lean` rad up a vertical slope (`touch_attitude.py`).
    Search: durations `t_min`..`t_max`, terminal thrusts `f_min`..`f_max`; every `replan` s; none in the last `freeze`
    s, in the last `freeze_flat` over a flat board, which is out of sight by then: what is foretold of it changes
    without getting better. The board may leave the view in the last `blind` s at no cost. `w_*` weights of the cost. A
    plan is started below `commit_cost` / cos(inclination) and given up above `abort_cost` or if nothing was seen for
    `lost_age`.
    `predict_tau`: decay of the board's acceleration in the prediction, `filter_tau` in the belief filter;
    `predict_trust` 0..1 in the speeds of the predictor's network. Where a board slows down the network goes on slowing
    it and the decaying acceleration stops too soon: on steep boards, where timing is all, the truth is between.
    Commit: the believed position and speed must be known to `commit_sigma`, `commit_speed_sigma`, the last exposure be
    younger than `commit_age`, `commit_streak` detections be accepted, and the newest speeds have been foretold to
    `commit_surprise` m/s; the demands relax by 1 every `relax_after` s (that on
    foretelling by `relax_surprise`). `miss_after`: contact overdue; then
    `around_time` s of climbing away. Following: distance and elevation of the standoff, for steep and flat boards.
    Tracking: `fade` s before contact position feedback ends; gains; yaw is left alone within `yaw_near` m.
    Run-up (from `run_inclination` on, `run_slow` more for a slow board; there `steep` is also put over the other
    values): thrust and body rate of the flare it leads to; its acceleration, the coast after it, the vertical
    acceleration (at most); gains; speed towards its start by the distance from it (`run_pull` 1/s, `follow_speed` at
    most); how near (`run_away`) and how straight (`run_turn`) it begins; when before the flare's gate (`run_commit`)
    and below which cost (`run_cost`) the perch is planned. A board whose speed swings is met while it is slow: the
    speed foretold for contact must be in the lowest `run_swing` of its range, which widens as other demands.
    Glide: boards flatter than `glide_inclination` (0: none) are not planned for but approached in sight
    (`planner_glide.py`), unless they are known exactly.
    """

    gravity: float = 9.80665
    drag: float = 0.2
    thrust_min: float = 4.8
    thrust_max: float = 14.8
    rate_max: float = 3.5
    rate_lag: float = 0.058
    thrust_lag: float = 0.035
    camera_tilt: float = math.radians(15.0)
    camera_half_fov: float = math.radians(24.0)
    robot_l: float = 0.04
    robot_r: float = 0.13
    impact_speed: float = 0.8
    overshoot: float = 0.0
    flatten: float = 1.0
    t_min: float = 0.7
    t_max: float = 2.6
    f_min: float = 5.5
    f_max: float = 12.0
    replan: float = 0.05
    freeze: float = 0.345
    blind: float = 0.27
    w_time: float = 0.9
    w_postpone: float = 3.9
    w_thrust: float = 1.24
    w_rate: float = 3.0
    w_clearance: float = 1000.0
    w_view: float = 1.25
    w_speed: float = 1.0
    w_force: float = 0.07
    w_skid: float = 1.5
    skid: float = 0.1
    predict_tau: float = 0.8
    filter_tau: float = BeliefParams.accel_tau
    relax_surprise: float = 1.0
    commit_surprise: float = 0.07
    run_inclination: float = math.radians(62.0)
    run_thrust: float = 12.6
    run_rate: float = 3.24
    run_accel: float = 1.46
    run_coast: float = 0.2
    run_rise: float = 0.95
    run_kp: float = 2.13
    run_kv: float = 3.89
    run_away: float = 0.6
    run_turn: float = 0.5
    run_commit: float = 1.16
    run_cost: float = 10.1
    speed_max: float = 5.0
    commit_cost: float = 2.0
    abort_cost: float = 17.0
    commit_sigma: float = 0.04
    commit_speed_sigma: float = 0.31
    commit_age: float = 0.097
    commit_streak: float = 8.0
    relax_after: float = 3.3
    lost_age: float = 0.94
    miss_after: float = 0.08
    around_time: float = 0.6
    standoff: float = 2.9
    standoff_flat: float = 1.5
    elevation: float = math.radians(18.5)
    elevation_flat: float = math.radians(29.3)
    follow_kp: float = 1.45
    follow_kv: float = 5.4
    follow_speed: float = 2.0
    follow_tilt: float = math.radians(25.0)
    fade: float = 0.36
    track_kp: float = 8.6
    track_kv: float = 5.6
    attitude_k: float = 12.0
    yaw_k: float = 1.65
    yaw_rate_max: float = 1.5
    yaw_near: float = 0.5
    touch_from: float = 0.3
    touch_speed: float = 0.58
    touch_band: float = 0.4
    touch_skid: float = 0.33
    touch_early: float = 0.02
    touch_late: float = 0.04
    touch_keep: float = 0.0015
    touch_lag: float = 0.02
    run_swing: float = 0.14
    overshoot_swing: float = 0.0
    aim: float = 0.0
    miss: float = 0.1
    predict_trust: float = 1.0
    freeze_flat: float = 0.48
    lean: float = 0.06
    touch_steep: float = 0.2
    touch_lean: float = 0.1
    glide_inclination: float = math.radians(12.0)
    run_slow: float = math.radians(6.0)
    touch_unsure: float = 3.0
    touch_miss: float = 9.0
    impact_unsure: float = 10.0
    run_pull: float = 0.8

    steep: Mapping[str, float] = field(default_factory=lambda: dict(STEEP))

    def __post_init__(self) -> None:
        unknown = set(self.steep) - set(self._names())
        if unknown:
            raise ValueError(
                f"planner parameters for steep boards name what does not exist: {', '.join(sorted(unknown))}"
            )
        for names in (self._flat(), {**self._flat(), **self.steep}):
            for name, value in names.items():
                if not math.isfinite(value) or (value < 0.0 and name not in ("overshoot", "lean")):
                    raise ValueError(f"planner parameter {name} is {value}; give a finite number that is not negative")
            if not 0.0 < names["t_min"] < names["t_max"] or not 0.0 < names["f_min"] <= names["f_max"]:
                raise ValueError("planner parameters need 0 < t_min < t_max and 0 < f_min <= f_max")
            if names["thrust_min"] >= names["thrust_max"] or names["replan"] <= 0.0:
                raise ValueError("planner parameters need thrust_min < thrust_max and replan > 0")

    @classmethod
    def _names(cls) -> list[str]:
        return [each.name for each in fields(cls) if each.name != "steep"]

    def _flat(self) -> dict[str, float]:
        return {name: getattr(self, name) for name in self._names()}

    def row(self) -> np.ndarray:
        """The row for kernels ((2 * COUNT,)): the parameters, then those with `steep` put over them."""
        flat = self._flat()
        return np.array([*flat.values(), *{**flat, **self.steep}.values()], dtype=np.float64)
