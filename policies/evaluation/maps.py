"""Wider evaluations: the paper's four trajectory families, changed vehicles and cameras, speed x inclination map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

from policies.environment.config import EnvConfig
from policies.evaluation.evaluate import POINTS, Policy, Row, Watch, fly_cases, part, point, run_episodes, summarise
from policies.evaluation.plot import heat_map

MOTIONS = {"spline": 0, "line": 1, "racetrack": 2, "figure8": 3}
_INCLINATIONS = (0.0, 30.0, 60.0)
_PAPER_S = ("T1", "T2", "T3")

VEHICLES: dict[str, dict] = {
    "no drag": {"drag": (0.0, 0.0)},
    "drag x3": {"drag": (3.0, 3.0)},
    "wind to 3 m/s": {"wind": 3.0},
    "motors x1.6 slower": {"motor_lag": (1.6, 1.6)},
    "rate loop x0.6": {"rate_gain": (0.6, 0.6)},
    "thrust +-25 %": {"thrust_to_weight": 0.25},
    "car 0.4 s late": {"car_lag": (0.4, 0.4)},
}
CAMERAS: dict[str, dict] = {
    "60-90 ms late": {"latency": (0.06, 0.09)},
    "10-20 Hz": {"detector_hz": (10.0, 20.0)},
    "camera +-8 deg": {"camera_tilt_deg": 8.0},
    "odometry noise x4": {"odometry_noise": 4.0},
}


def motions(
    policy: Policy,
    config: EnvConfig,
    episodes: int = 500,
    speeds: tuple[float, ...] = (1.0, 2.0),
    noise: str = "paper",
    watch: Watch | None = None,
) -> list[Row]:
    """The paper's four trajectory families at `speeds` m/s and 0, 30, 60 deg of inclination, constant speed on the
    structured ones (that of a line oscillates by itself) and Ornstein-Uhlenbeck on splines."""
    cases = {}
    for family, speed, tilt in product(MOTIONS, speeds, _INCLINATIONS):
        odds = tuple(float(j == MOTIONS[family]) for j in range(6))
        law = (0, 1.0, 0, 0) if family == "spline" else (1.0, 0, 0, 0)
        cases[f"{family} {speed:g} m/s {tilt:g} deg"] = {**point(speed, tilt), "families": odds, "laws": law}
    return fly_cases(policy, replace(config, count=episodes), cases, noise, watch)


def robustness(
    policy: Policy, config: EnvConfig, episodes: int = 500, noise: str = "paper", watch: Watch | None = None
) -> list[Row]:
    """The paper's operating points with one change at a time: VEHICLES, and in the vision stage CAMERAS too."""
    others = {**VEHICLES, **CAMERAS} if config.stage == "vision" else VEHICLES
    cases = {f"{at}, {name}": {**POINTS[at], **change} for (name, change), at in product(others.items(), _PAPER_S)}
    return fly_cases(policy, replace(config, count=episodes), cases, noise, watch)


@dataclass(frozen=True)
class HeatMap:
    """Success (percent) over speed (columns, m/s) and inclination (rows, deg), `episodes` a cell."""

    speeds: list[float]
    inclinations_deg: list[float]
    success: list[list[float]]
    episodes: int

    def svg(self, title: str) -> str:
        """As a picture with 50 and 70 percent contours."""
        return heat_map(self.speeds, self.inclinations_deg, self.success, title)

    def csv(self) -> str:
        """As data: one line a cell."""
        lines = ["speed,inclination_deg,success_percent,episodes"]
        for inclination, line in zip(self.inclinations_deg, self.success, strict=True):
            for speed, value in zip(self.speeds, line, strict=True):
                lines.append(f"{speed:g},{inclination:g},{value:.6g},{self.episodes}")
        return "\n".join(lines) + "\n"


def heatmap(
    policy: Policy, config: EnvConfig, episodes: int = 100, noise: str = "paper", watch: Watch | None = None
) -> HeatMap:
    """The paper's speed x inclination map: random splines, 0 to 3.5 m/s, 0 to 80 deg."""
    speeds = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5]
    inclinations = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0]
    cells = len(speeds) * len(inclinations)
    success: list[list[float]] = []
    for j, inclination in enumerate(inclinations):
        line = []
        for i, speed in enumerate(speeds):
            settings = replace(config, count=episodes, **point(speed, inclination))
            ended = run_episodes(policy, settings, noise=noise, watch=part(watch, j * len(speeds) + i, cells))
            line.append(summarise("", ended).success)
        success.append(line)
    return HeatMap(speeds, inclinations, success, episodes)
