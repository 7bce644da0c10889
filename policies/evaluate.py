"""How well a policy perches: the paper's operating points, the training distribution, motions, a heat map.

Every row of the environment contributes the same number of episodes, its first ones, so that quick ends are not counted
more often than slow ones. Intervals are exact (Clopper-Pearson).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.table import Table

from policies.contact import (
    ATTACHED,
    NORMAL_ERROR,
    NORMAL_SPEED,
    OUTCOME,
    PLANAR,
    REASON,
    REASONS,
    SUCCESS,
    TANGENTIAL_SPEED,
)
from policies.contract import check_contract, open_policy
from policies.env import Env
from policies.env_config import TICK, EnvConfig
from policies.env_rows import E_RHO, E_SEEN, E_STEPS
from policies.train_plot import heat_map
from scenarios.paper import SimulatedRow, published

Policy = Callable[[Env], np.ndarray]
"""Environment in, actions ((N, 4) in [-1, 1]) out; called once a step."""

_SPLINE, _OU = (1.0, 0, 0, 0, 0, 0), (0, 1.0, 0, 0)
IMPACT_BAND = (0.4, 0.65)  # m/s along the normal, the paper's flights


def point(speed: float, inclination_deg: float) -> dict:
    """Settings of an operating point of the paper: random splines, Ornstein-Uhlenbeck speed, a car that follows."""
    return {
        "speed": (speed, speed),
        "inclination_deg": (inclination_deg, inclination_deg),
        "families": _SPLINE,
        "laws": _OU,
        "car_lag": (0.0, 0.0),
    }


POINTS: dict[str, dict] = {
    "T1": point(3.0, 0.0),
    "T2": point(2.0, 30.0),
    "T3": point(1.0, 60.0),
    "2.0@70": point(2.0, 70.0),
    "hard-i-like": {**point(2.5, 70.0), "speed": (1.0, 2.5), "laws": (0, 0, 1.0, 0), "car_lag": (0.0, 0.2)},
    "paper-training": {"speed": (0.0, 2.5), "families": _SPLINE, "laws": _OU, "car_lag": (0.0, 0.0)},
    "own-training": {},
}


@dataclass(frozen=True)
class Row:
    """One line of the table. Rates in percent with their exact 95 % interval; means over successes, SI units."""

    name: str
    episodes: int
    success: float
    low: float
    high: float
    attached: float
    duration: float
    position_error: float
    normal_error: float
    tangential_speed: float
    normal_speed: float
    normal_speed_5: float
    normal_speed_95: float
    in_band: float
    seen: float
    rho: float
    causes: dict[str, int]


def clopper_pearson(hits: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact binomial interval of a rate: where the tails of either side hold (1 - confidence) / 2."""
    if not 0 <= hits <= trials or trials < 1:
        raise ValueError(f"{hits} successes of {trials} is not a rate")
    tail = 0.5 * (1.0 - confidence)
    terms = [math.lgamma(trials + 1) - math.lgamma(k + 1) - math.lgamma(trials - k + 1) for k in range(trials + 1)]

    def at_most(k: int, p: float) -> float:
        if p <= 0.0 or p >= 1.0:
            return 1.0 if p <= 0.0 or k >= trials else 0.0
        a, b = math.log(p), math.log1p(-p)
        return math.fsum(math.exp(terms[j] + j * a + (trials - j) * b) for j in range(k + 1))

    def solve(wanted: float, k: int) -> float:
        low, high = 0.0, 1.0
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if at_most(k, middle) > wanted else (low, middle)
        return 0.5 * (low + high)

    lower = 0.0 if hits == 0 else solve(1.0 - tail, hits - 1)
    upper = 1.0 if hits == trials else solve(tail, hits)
    return lower, upper


def run_episodes(policy: Policy, config: EnvConfig, each: int = 1) -> np.ndarray:
    """The first `each` episodes of every row, as ended rows ((count * each, ENDED_DIM))."""
    env = Env(config)
    env.reset()
    counted = np.zeros(config.count, dtype=np.int64)
    parts = []
    while (counted < each).any():
        env.step(policy(env))
        done = env.rows.done.astype(bool)
        parts.append(env.rows.ended[done & (counted < each)].copy())
        counted[done] += 1
    return np.concatenate(parts)


def summarise(name: str, ended: np.ndarray) -> Row:
    """A table's line from ended rows."""
    good = ended[ended[:, OUTCOME] == SUCCESS]
    hits, trials = len(good), len(ended)
    low, high = clopper_pearson(hits, trials)
    shown = good if hits else np.full((1, ended.shape[1]), math.nan)
    into = -shown[:, NORMAL_SPEED]
    causes: dict[str, int] = {}
    for outcome, reason in ended[:, [OUTCOME, REASON]].astype(int):
        if outcome != SUCCESS:
            causes[REASONS[reason]] = causes.get(REASONS[reason], 0) + 1
    return Row(
        name=name,
        episodes=trials,
        success=100.0 * hits / trials,
        low=100.0 * low,
        high=100.0 * high,
        attached=100.0 * float(ended[:, ATTACHED].mean()),
        duration=float(shown[:, E_STEPS].mean()) * TICK,
        position_error=float(shown[:, PLANAR].mean()),
        normal_error=float(shown[:, NORMAL_ERROR].mean()),
        tangential_speed=float(shown[:, TANGENTIAL_SPEED].mean()),
        normal_speed=float(into.mean()),
        normal_speed_5=float(np.percentile(into, 5)),
        normal_speed_95=float(np.percentile(into, 95)),
        in_band=100.0 * float(((into >= IMPACT_BAND[0]) & (into <= IMPACT_BAND[1])).mean()),
        seen=100.0 * float(ended[:, E_SEEN].mean()),
        rho=float(ended[:, E_RHO].mean()),
        causes=causes,
    )


def evaluate(
    policy: Policy, config: EnvConfig, episodes: int = 2000, points: tuple[str, ...] = tuple(POINTS)
) -> list[Row]:
    """The table: `episodes` or a few more at each of `points`, on `config`'s stage, seed and randomisation."""
    each = 4 if episodes >= 1000 else 1
    count = math.ceil(episodes / each)
    rows = []
    for name in points:
        settings = replace(config, count=count, **POINTS[name])
        rows.append(summarise(name, run_episodes(policy, settings, each)))
    return rows


MOTIONS = {"spline": 0, "line": 1, "racetrack": 2, "figure8": 3}


def motions(
    policy: Policy, config: EnvConfig, episodes: int = 500, speeds: tuple[float, ...] = (1.0, 2.0)
) -> list[Row]:
    """The paper's four trajectory families at `speeds` m/s and 0, 30, 60 deg of inclination, constant speed on the
    structured ones (a line's own speed swings) and Ornstein-Uhlenbeck on splines."""
    rows = []
    for family, index in MOTIONS.items():
        odds = tuple(float(k == index) for k in range(6))
        for speed in speeds:
            for inclination in (0.0, 30.0, 60.0):
                law = (0, 1.0, 0, 0) if family == "spline" else (1.0, 0, 0, 0)
                settings = {**point(speed, inclination), "families": odds, "laws": law}
                name = f"{family} {speed:g} m/s {inclination:g} deg"
                rows.append(summarise(name, run_episodes(policy, replace(config, count=episodes, **settings))))
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


def heatmap(policy: Policy, config: EnvConfig, episodes: int = 100) -> HeatMap:
    """The paper's speed x inclination map: random splines, 0 to 3.5 m/s, 0 to 80 deg."""
    speeds = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5]
    inclinations = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0]
    success = []
    for inclination in inclinations:
        line = []
        for speed in speeds:
            ended = run_episodes(policy, replace(config, count=episodes, **point(speed, inclination)))
            line.append(100.0 * float((ended[:, OUTCOME] == SUCCESS).mean()))
        success.append(line)
    return HeatMap(speeds, inclinations, success, episodes)


def as_data(rows: list[Row]) -> list[dict]:
    """Rows as plain data, for JSON."""
    return [asdict(row) for row in rows]


def table(rows: list[Row], stage: str, title: str = "") -> Table:
    """The rows beside the paper's (T1 to T3), as a rich table. Means are over successes."""
    grid = Table(title=title or f"{stage}-based", title_justify="left")
    heads = ("point", "n", "success %", "95 %", "time s", "pos m", "angle rad", "v_t m/s", "v_n m/s", "in 0.4-0.65 %")
    for head in (*heads, "seen %", "failures"):
        grid.add_column(head, justify="left" if head in ("point", "failures") else "right")
    for row in rows:
        causes = ", ".join(f"{k} {v}" for k, v in sorted(row.causes.items(), key=lambda item: -item[1]))
        grid.add_row(
            row.name,
            str(row.episodes),
            f"{row.success:.2f}",
            f"{row.low:.2f}-{row.high:.2f}",
            f"{row.duration:.3f}",
            f"{row.position_error:.3f}",
            f"{row.normal_error:.3f}",
            f"{row.tangential_speed:.3f}",
            f"{row.normal_speed:.2f} ({row.normal_speed_5:.2f}-{row.normal_speed_95:.2f})",
            f"{row.in_band:.0f}",
            f"{row.seen:.0f}",
            causes,
        )
        if row.name in ("T1", "T2", "T3"):
            said = published(f"{stage}.{row.name.lower()}")
            assert isinstance(said, SimulatedRow)
            grid.add_row(
                f"  {row.name} published",
                "",
                f"{said.success_percent:.2f}",
                "",
                f"{said.duration:.3f}",
                f"{said.position_error:.3f}",
                f"{said.normal_error:.3f}",
                f"{said.tangential_speed:.3f}",
                style="dim",
            )
    return grid


class OnnxPolicy:
    """An exported policy as a `Policy`: what flies, on the training's environment. Raises ContractError."""

    def __init__(self, path: str | Path) -> None:
        self.session, self.contract = open_policy(path)
        check_contract(self.contract)

    def __call__(self, env: Env) -> np.ndarray:
        return self.session.run(None, {"observation": env.rows.observation})[0]

    def settings(self, seed: int) -> EnvConfig:
        """The environment that this policy is to be judged in: its stage and history, hovering starts in vision."""
        stage, stride = self.contract.stage, self.contract.observation.stride
        noise = 0.0 if stage == "state" else 1.0
        return EnvConfig(stage=stage, stride=stride, seed=seed, airframe=self.contract.airframe, odometry_noise=noise)
