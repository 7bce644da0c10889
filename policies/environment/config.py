"""Settings of the training environment and the ranges of its randomisation: a checked dataclass, a row for kernels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from policies.environment import config_row as c
from policies.task.contact import ContactRules
from policies.task.observation import HISTORY
from policies.task.reward import RewardWeights

TICK = 0.01  # s, one control step
FAMILIES = ("spline", "line", "racetrack", "figure8", "circle", "static")
LAWS = ("constant", "ou", "cosine", "steps")

Pair = tuple[float, float]


@dataclass(frozen=True)
class EnvConfig:
    """Settings of the environment. Raises ValueError for one that is out of range.

    A pair is the range (low, high) of one uniform draw per episode; a single number is the half-width of a draw, unless
    the text below says otherwise. SI units; a name that ends in `_deg` is in degrees.

    Start, domain randomisation and detector rate are the paper's (tables "Initialization parameters" and App. "Domain
    Randomization"). Beyond it, because the harness has them: `car_lag` (time constant of the car's answer, up to),
    `latency` from exposure to a filter update, `command_delay` from action to motors (s), `wind` (mean, up to),
    `odometry_noise` (scale of 2 cm/s and 3 mrad one-sigma in the vehicle's own estimate), and factors of the
    airframe's `drag` (the paper's equations have none: what is drawn below 0 is 0), `motor_lag` and body rate loop
    (`rate_gain`).
    `noise_scale` multiplies the paper's visual noise; `noise_power` above 1 draws small scales more often (half below a
    quarter of the range at 2): this project's detector has a tenth of the paper's noise. `families`, `laws`: odds of
    each of FAMILIES and LAWS.
    `oscillating`: share of all episodes that are over steep boards with an oscillating speed as in Hard-I, whatever the
    other ranges say; `hard_examples`: share of the others over boards that are hard by their speed (hard-example
    sampling), flat at 2.4 to 3.2 m/s or steep at 1.2 to 2.5 m/s.
    `warm`: share of episodes in which the vehicle first hovers for `warm_time` and observes the board (as the harness
    does before it engages). `substeps` of physics in 10 ms. `horizon`: control steps of true future kept for teachers
    and critics.
    `guidance`: the laws of `policies/guidance/guide.py` act on every action before it is delayed and flown, by the
    belief and the odometry that the policy received. The next observation and the reward receive the guided action.
    `guidance_changes`: values that replace GuidanceParams' defaults, by field name.
    `augmentation` False and `rho` False are the paper's ablations (raw poses and their differences; rho fixed to 1).
    """

    stage: str = "state"
    count: int = 1024
    seed: int = 0
    airframe: str = "paper_quad"
    stride: int = 3
    future_stride: int = 5
    horizon: int = 320
    limit: int = 500
    substeps: int = 5
    speed: Pair = (0.0, 3.2)
    inclination_deg: Pair = (0.0, 80.0)
    families: tuple[float, ...] = (0.6, 0.1, 0.1, 0.1, 0.05, 0.05)
    laws: tuple[float, ...] = (0.1, 0.5, 0.25, 0.15)
    oscillating: float = 0.0
    hard_examples: float = 0.0
    car_lag: Pair = (0.0, 0.2)
    distance: Pair = (1.2, 3.5)
    height: Pair = (1.2, 2.0)
    azimuth_deg: float = 60.0
    tilt: float = 0.6
    yaw: float = 0.2
    velocity_xy: float = 0.1
    velocity_z: float = 0.2
    rate_xy: float = 0.2
    rate_z: float = 0.1
    mass: float = 0.30
    inertia: float = 0.10
    thrust_to_weight: float = 0.15
    drag: Pair = (0.0, 2.0)
    motor_lag: Pair = (1.0, 1.0)
    rate_gain: Pair = (1.0, 1.0)
    camera_tilt_deg: float = 5.0
    detector_hz: Pair = (20.0, 60.0)
    latency: Pair = (0.02, 0.045)
    noise_scale: Pair = (0.3, 1.0)
    noise_power: float = 1.0
    command_delay: Pair = (0.002, 0.014)
    wind: float = 0.0
    odometry_noise: float = 1.0
    augmentation: bool = True
    rho: bool = True
    warm: float = 0.0
    warm_time: Pair = (0.15, 1.0)
    gain_slot: bool = True
    guidance: bool = False
    guidance_changes: Mapping[str, float] = field(default_factory=dict)
    rules: ContactRules = field(default_factory=ContactRules)
    weights: RewardWeights = field(default_factory=RewardWeights)

    def __post_init__(self) -> None:
        if self.stage not in ("state", "vision"):
            raise ValueError(f"stage is '{self.stage}'; it is 'state' (truth) or 'vision' (belief from a camera)")
        for name in ("count", "horizon", "limit", "substeps", "stride", "future_stride"):
            if getattr(self, name) < 1:
                raise ValueError(f"environment setting {name} is {getattr(self, name)}; it must be at least 1")
        if len(self.families) != len(FAMILIES) or len(self.laws) != len(LAWS):
            raise ValueError(f"families needs {len(FAMILIES)} odds {FAMILIES}, laws {len(LAWS)} {LAWS}")
        if min(self.families + self.laws) < 0.0 or sum(self.families) <= 0.0 or sum(self.laws) <= 0.0:
            raise ValueError("odds of families and laws must not be negative and not all be zero")
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name not in ("families", "laws") and isinstance(value, tuple) and not value[0] <= value[1]:
                raise ValueError(f"environment range {item.name} is {value}; give (low, high) in order")
        if self.noise_power <= 0.0:
            raise ValueError(f"noise_power is {self.noise_power}; it must be positive")
        if self.command_delay[1] > 0.0199:
            raise ValueError(f"command_delay reaches {self.command_delay[1]} s; at most 0.0199 is modelled")
        if self.latency[1] > 0.1:
            raise ValueError(f"latency reaches {self.latency[1]} s; at most 0.1 is modelled")

    @property
    def history(self) -> int:
        """Control steps that the observation's history spans."""
        return (HISTORY - 1) * self.stride + 1

    def row(self) -> np.ndarray:
        """The (config_row.DIM,) row for kernels."""
        families, laws = np.cumsum(self.families) / sum(self.families), np.cumsum(self.laws) / sum(self.laws)
        degrees = math.radians(1.0)
        row = np.zeros(c.DIM)
        for low, pair in (
            (c.SPEED_LOW, self.speed), (c.INCLINATION_LOW, [value * degrees for value in self.inclination_deg]),
            (c.DISTANCE_LOW, self.distance), (c.HEIGHT_LOW, self.height), (c.DETECTOR_LOW, self.detector_hz),
            (c.LATENCY_LOW, self.latency), (c.NOISE_LOW, self.noise_scale), (c.COMMAND_DELAY_LOW, self.command_delay),
            (c.WARM_TIME_LOW, self.warm_time), (c.DRAG_LOW, self.drag), (c.MOTOR_LAG_LOW, self.motor_lag),
            (c.RATE_GAIN_LOW, self.rate_gain),
        ):  # fmt: skip
            row[low : low + 2] = pair
        row[c.FAMILY : c.FAMILY + len(families)], row[c.LAW : c.LAW + len(laws)] = families, laws
        row[c.CAR_LAG] = self.car_lag[1]
        row[c.AZIMUTH], row[c.CAMERA_TILT] = self.azimuth_deg * degrees, self.camera_tilt_deg * degrees
        row[c.TILT], row[c.YAW] = self.tilt, self.yaw
        row[c.VELOCITY_XY], row[c.VELOCITY_Z] = self.velocity_xy, self.velocity_z
        row[c.RATE_XY], row[c.RATE_Z] = self.rate_xy, self.rate_z
        row[c.MASS], row[c.INERTIA], row[c.THRUST_TO_WEIGHT] = self.mass, self.inertia, self.thrust_to_weight
        row[c.WIND], row[c.ODOMETRY], row[c.WARM] = self.wind, self.odometry_noise, self.warm
        row[c.VISION], row[c.AUGMENTATION], row[c.RHO] = self.stage == "vision", self.augmentation, self.rho
        row[c.STRIDE], row[c.FUTURE_STRIDE] = self.stride, self.future_stride
        row[c.LIMIT], row[c.SUBSTEPS] = self.limit, self.substeps
        row[c.GAIN_SLOT], row[c.GUIDANCE] = self.gain_slot, self.guidance
        row[c.OSCILLATING], row[c.HARD_EXAMPLES] = self.oscillating, self.hard_examples
        row[c.NOISE_POWER] = self.noise_power
        return row
