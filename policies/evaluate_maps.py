"""Wider looks at a policy: the paper's four trajectory families, and the map of speed and inclination."""

from __future__ import annotations

from dataclasses import dataclass, replace

from policies.env_config import EnvConfig
from policies.evaluate import Policy, Row, Watch, part, point, run_episodes, summarise
from policies.train_plot import heat_map

MOTIONS = {"spline": 0, "line": 1, "racetrack": 2, "figure8": 3}
_INCLINATIONS = (0.0, 30.0, 60.0)


def motions(
    policy: Policy,
    config: EnvConfig,
    episodes: int = 500,
    speeds: tuple[float, ...] = (1.0, 2.0),
    noise: str = "paper",
    watch: Watch | None = None,
) -> list[Row]:
    """The paper's four trajectory families at `speeds` m/s and 0, 30, 60 deg of inclination, constant speed on the
    structured ones (a line's own speed swings) and Ornstein-Uhlenbeck on splines."""
    cases = [(family, speed, tilt) for family in MOTIONS for speed in speeds for tilt in _INCLINATIONS]
    rows = []
    for k, (family, speed, tilt) in enumerate(cases):
        odds = tuple(float(j == MOTIONS[family]) for j in range(6))
        law = (0, 1.0, 0, 0) if family == "spline" else (1.0, 0, 0, 0)
        settings = replace(config, count=episodes, **{**point(speed, tilt), "families": odds, "laws": law})
        ended = run_episodes(policy, settings, noise=noise, watch=part(watch, k, len(cases)))
        rows.append(summarise(f"{family} {speed:g} m/s {tilt:g} deg", ended))
    return rows


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
