"""How well a policy perches, measured in the training environment: the paper's operating points and the distributions.

Every row of the environment contributes the same number of episodes, its first ones, so that quick ends are not counted
more often than slow ones. Evaluation uses other seeds than training and tuning: see `evaluation_seed`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from policies.environment import ended_row
from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from policies.task import result_row
from policies.task.contact import REASONS, SUCCESS
from vehicle.camera.noise import measured_noise, paper_noise

Policy = Callable[[Env], np.ndarray]
"""Environment in, actions ((N, 4) in [-1, 1]) out; called once a step."""
Watch = Callable[[float], None]
"""Called with the share of the work that is done, 0 to 1."""

NOISES = {"paper": paper_noise, "measured": measured_noise}
"""Noise of the simulated detector: the paper's table, or what this project's renderer and detector show."""

_SPLINE, _OU = (1.0, 0, 0, 0, 0, 0), (0, 1.0, 0, 0)
IMPACT_BAND = (0.4, 0.65)  # m/s along the normal, the paper's flights
_FIRST_SEED = 1 << 40


def evaluation_seed(seed: int) -> int:
    """The environment's seed for evaluation `seed` (0, 1, ...).

    Training draws from seeds below 2**40 (1000 times its own seed, plus the process), tuning from small ones; these
    lie above, so that no policy is evaluated on episodes of its training or tuning.
    """
    if not 0 <= seed < _FIRST_SEED:
        raise ValueError(f"seed {seed}: give one from 0 to {_FIRST_SEED - 1}")
    return _FIRST_SEED + seed


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
    """One line of the table: `hits` of `episodes`; rates in percent; means over successes, SI units."""

    name: str
    episodes: int
    hits: int
    success: float
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


def run_episodes(
    policy: Policy, config: EnvConfig, each: int = 1, noise: str = "paper", watch: Watch | None = None
) -> np.ndarray:
    """The first `each` episodes of every row, as ended rows ((count * each, ended_row.DIM)). `noise`: one of NOISES."""
    env = Env(config)
    env.shared = env.shared._replace(noise=NOISES[noise]())
    env.reset()
    counted = np.zeros(config.count, dtype=np.int64)
    parts = []
    while (counted < each).any():
        env.step(policy(env))
        done = env.rows.done.astype(bool)
        if not done.any():
            continue
        env.tally.__init__()
        parts.append(env.rows.ended[done & (counted < each)].copy())
        counted[done] += 1
        if watch is not None:
            watch(float(np.minimum(counted, each).mean()) / each)
    return np.concatenate(parts)


def summarise(name: str, ended: np.ndarray) -> Row:
    """A table's line from ended rows."""
    good = ended[ended[:, result_row.OUTCOME] == SUCCESS]
    hits, trials = len(good), len(ended)
    shown = good if hits else np.full((1, ended.shape[1]), math.nan)
    into = -shown[:, result_row.NORMAL_SPEED]
    causes: dict[str, int] = {}
    for outcome, reason in ended[:, [result_row.OUTCOME, result_row.REASON]].astype(int):
        if outcome != SUCCESS:
            causes[REASONS[reason]] = causes.get(REASONS[reason], 0) + 1
    return Row(
        name=name,
        episodes=trials,
        hits=hits,
        success=100.0 * hits / trials,
        attached=100.0 * float(ended[:, result_row.ATTACHED].mean()),
        duration=float(shown[:, ended_row.STEPS].mean()) * TICK,
        position_error=float(shown[:, result_row.PLANAR].mean()),
        normal_error=float(shown[:, result_row.NORMAL_ERROR].mean()),
        tangential_speed=float(shown[:, result_row.TANGENTIAL_SPEED].mean()),
        normal_speed=float(into.mean()),
        normal_speed_5=float(np.percentile(into, 5)),
        normal_speed_95=float(np.percentile(into, 95)),
        in_band=100.0 * float(((into >= IMPACT_BAND[0]) & (into <= IMPACT_BAND[1])).mean()),
        seen=100.0 * float(ended[:, ended_row.SEEN].mean()),
        rho=float(ended[:, ended_row.RHO].mean()),
        causes=causes,
    )


@dataclass(frozen=True)
class Case:
    """One line of a table to be flown: `each` episodes of every row of `config`'s environment."""

    name: str
    config: EnvConfig
    each: int = 1


def fly_case(policy: Policy, case: Case, noise: str = "paper", watch: Watch | None = None) -> Row:
    """Its line. `noise`: one of NOISES."""
    return summarise(case.name, run_episodes(policy, case.config, case.each, noise, watch))


def fly_cases(policy: Policy, cases: Sequence[Case], noise: str = "paper", watch: Watch | None = None) -> list[Row]:
    """A table: a line for each case, flown in this process."""
    return [fly_case(policy, case, noise, _part(watch, k, len(cases))) for k, case in enumerate(cases)]


def _part(watch: Watch | None, index: int, count: int) -> Watch | None:
    """The watch of one of `count` equal pieces of work."""
    return None if watch is None else lambda share: watch((index + share) / count)


def changed(config: EnvConfig, changes: Mapping[str, Mapping[str, Any]], each: int = 1) -> list[Case]:
    """A case for each of `changes` of `config`, by name."""
    return [Case(name, replace(config, **change), each) for name, change in changes.items()]


def points(config: EnvConfig, episodes: int = 2000, names: tuple[str, ...] = tuple(POINTS)) -> list[Case]:
    """`episodes` or a few more at each of the points `names`, on `config`'s stage, seed and randomisation."""
    each = 4 if episodes >= 1000 else 1
    config = replace(config, count=math.ceil(episodes / each))
    return changed(config, {name: POINTS[name] for name in names}, each)


def as_data(rows: list[Row]) -> list[dict]:
    """Rows as plain data, for JSON."""
    return [asdict(row) for row in rows]
