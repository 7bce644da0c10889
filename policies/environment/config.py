"""What the training environment randomises and how it runs: a checked dataclass and the row its kernels take."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

import numpy as np

from policies.task.contact import ContactRules
from policies.task.observation import HISTORY
from policies.task.reward import RewardWeights

TICK = 0.01  # s, one control step
FAMILIES = ("spline", "line", "racetrack", "figure8", "circle", "static")
LAWS = ("constant", "ou", "cosine", "steps")

(C_SPEED_LOW, C_SPEED_HIGH, C_INC_LOW, C_INC_HIGH, C_FAMILY, C_LAW, C_CAR_LAG, C_DISTANCE_LOW, C_DISTANCE_HIGH,
 C_HEIGHT_LOW, C_HEIGHT_HIGH, C_AZIMUTH, C_TILT0, C_YAW0, C_V0_XY, C_V0_Z, C_RATE0_XY, C_RATE0_Z,
 C_MASS, C_INERTIA, C_TWR, C_CAMERA_TILT, C_DET_LOW, C_DET_HIGH, C_LATENCY_LOW, C_LATENCY_HIGH, C_NOISE_LOW,
 C_NOISE_HIGH, C_COMMAND_LOW, C_COMMAND_HIGH, C_WIND, C_ODOMETRY, C_VISION, C_AUGMENTATION, C_RHO, C_WARM,
 C_WARM_LOW, C_WARM_HIGH, C_STRIDE, C_FUTURE_STRIDE, C_LIMIT, C_SUBSTEPS, C_GAIN, C_SWINGS, C_FRONTIER,
 C_NOISE_POWER, C_DRAG_LOW, C_DRAG_HIGH, C_MOTOR_LAG_LOW, C_MOTOR_LAG_HIGH, C_RATE_GAIN_LOW, C_RATE_GAIN_HIGH,
 C_GUIDANCE) = (
    0, 1, 2, 3, 4, 10, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37,
    38, 39, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 50, 51,
    52, 53, 54, 55, 56, 57, 58, 59, 60)  # fmt: skip
CONFIG_DIM = 61

Pair = tuple[float, float]


@dataclass(frozen=True)
class EnvConfig:
    """Ranges are (low, high) of uniform draws once an episode; single numbers half-widths. SI units, degrees if named.

    Start, domain randomisation and detector rate are the paper's (tables "Initialization parameters" and App. "Domain
    Randomization"). Beyond it, because the harness has them: `car_lag` (time constant of the car's answer, up to),
    `latency` from exposure to a filter update, `command_delay` from action to motors (s), `wind` (mean, up to),
    `odometry_noise` (scale of 2 cm/s and 3 mrad one-sigma in what the policy knows of itself), and factors of the
    airframe's `drag` (the paper's equations have none: what is drawn below 0 is 0), `motor_lag` and body rate loop
    (`rate_gain`).
    `noise_scale` multiplies the paper's visual noise; `noise_power` above 1 draws small scales more often (half below a
    quarter of the range at 2): our own detector's noise is a tenth of the paper's. `families`, `laws`: odds of each of
    FAMILIES and LAWS;
    `swings`: share of all episodes over steep boards whose speed swings as in Hard-I, whatever the other ranges say;
    `frontier`: share of the others over boards that are hard by their speed, flat at 2.4 to 3.2 m/s or steep at 1.2 to
    2.5 m/s.
    `warm`: share of episodes in which the drone first hovers and watches for `warm_time` (as the harness does before it
    engages). `substeps` of physics in 10 ms. `horizon`: control steps of true future kept for teachers and critics.
    `guidance`: the laws of `policies/guidance/guide.py` act on every action before it is delayed and flown, by the
    belief and the odometry that the policy was shown. The guided action is the one that the next observation and the
    reward are told of.
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
    swings: float = 0.0
    frontier: float = 0.0
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
        """The (CONFIG_DIM,) row for kernels."""
        families, laws = np.cumsum(self.families) / sum(self.families), np.cumsum(self.laws) / sum(self.laws)
        degrees = math.radians(1.0)
        row = np.array(
            [
                *self.speed,
                self.inclination_deg[0] * degrees,
                self.inclination_deg[1] * degrees,
                *families,
                *laws,
                self.car_lag[1],
                *self.distance,
                *self.height,
                self.azimuth_deg * degrees,
                self.tilt,
                self.yaw,
                self.velocity_xy,
                self.velocity_z,
                self.rate_xy,
                self.rate_z,
                self.mass,
                self.inertia,
                self.thrust_to_weight,
                self.camera_tilt_deg * degrees,
                *self.detector_hz,
                *self.latency,
                *self.noise_scale,
                *self.command_delay,
                self.wind,
                self.odometry_noise,
                float(self.stage == "vision"),
                float(self.augmentation),
                float(self.rho),
                self.warm,
                *self.warm_time,
                self.stride,
                self.future_stride,
                self.limit,
                self.substeps,
                float(self.gain_slot),
                self.swings,
                self.frontier,
                self.noise_power,
                *self.drag,
                *self.motor_lag,
                *self.rate_gain,
                float(self.guidance),
            ],
            dtype=np.float64,
        )
        assert row.shape == (CONFIG_DIM,)
        return row
