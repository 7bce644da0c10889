"""Wider evaluations: the paper's four trajectory families, changed vehicles and cameras, speed x inclination map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

from policies.environment.config import EnvConfig
from policies.evaluation.evaluate import POINTS, Case, Row, changed, point
from policies.evaluation.plot import heat_map

MOTIONS = {"spline": 0, "line": 1, "racetrack": 2, "figure8": 3}
_INCLINATIONS = (0.0, 30.0, 60.0)
_PAPER_S = ("T1", "T2", "T3")
_MAP_SPEEDS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
_MAP_DEG = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0)

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


def motions(config: EnvConfig, episodes: int = 500, speeds: tuple[float, ...] = (1.0, 2.0)) -> list[Case]:
    """The paper's four trajectory families at `speeds` m/s and 0, 30, 60 deg of inclination, constant speed on the
    structured ones (that of a line oscillates by itself) and Ornstein-Uhlenbeck on splines."""
    changes = {}
    for family, speed, tilt in product(MOTIONS, speeds, _INCLINATIONS):
        odds = tuple(float(j == MOTIONS[family]) for j in range(6))
        law = (0, 1.0, 0, 0) if family == "spline" else (1.0, 0, 0, 0)
        changes[f"{family} {speed:g} m/s {tilt:g} deg"] = {**point(speed, tilt), "families": odds, "laws": law}
    return changed(replace(config, count=episodes), changes)


def robustness(config: EnvConfig, episodes: int = 500) -> list[Case]:
    """The paper's operating points with one change at a time: VEHICLES, and in the vision stage CAMERAS too."""
    others = {**VEHICLES, **CAMERAS} if config.stage == "vision" else VEHICLES
    changes = {f"{at}, {name}": {**POINTS[at], **change} for (name, change), at in product(others.items(), _PAPER_S)}
    return changed(replace(config, count=episodes), changes)


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


def map_cells(config: EnvConfig, episodes: int = 100) -> list[Case]:
    """The cells of the paper's speed x inclination map, row by row: random splines, 0 to 3.5 m/s, 0 to 80 deg."""
    cells = {f"{speed:g} m/s {tilt:g} deg": point(speed, tilt) for tilt, speed in product(_MAP_DEG, _MAP_SPEEDS)}
    return changed(replace(config, count=episodes), cells)


def heatmap(rows: Sequence[Row]) -> HeatMap:
    """The map from the lines of `map_cells`, in their order."""
    width = len(_MAP_SPEEDS)
    success = [[row.success for row in rows[at : at + width]] for at in range(0, len(rows), width)]
    return HeatMap(list(_MAP_SPEEDS), list(_MAP_DEG), success, rows[0].episodes)
