"""What Gymnasium's interface costs: control steps a second of `PerchVectorEnv` against the bare environment.

    python -m benchmarks.bench_gym [--count 4096] [--seconds 12]

Both are stepped in turn, a spell each, so that a machine under load changes both alike; the ratio is that of the
medians of the spells. Mark: at least 0.95.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import gymnasium
import numpy as np

from policies.environment.config import EnvConfig
from policies.environment.env import Env, advance
from policies.gym import ID

SPELLS = 12


def spell(step: Callable[[np.ndarray], object], actions: np.ndarray, seconds: float) -> float:
    """Control steps a second of one spell."""
    begun, steps = time.perf_counter(), 0
    while time.perf_counter() - begun < seconds:
        step(actions)
        steps += 1
    return steps * len(actions) / (time.perf_counter() - begun)


def measure(stage: str, count: int, seconds: float) -> tuple[float, float]:
    """Medians: control steps a second of the bare environment and through Gymnasium."""
    bare = Env(EnvConfig(stage=stage, count=count, seed=1))
    bare.reset()
    ours = gymnasium.make_vec(ID, num_envs=count, stage=stage)
    ours.reset(seed=1)
    actions = np.random.default_rng(1).normal(0.0, 0.1, (count, 4)).astype(np.float32)
    lanes = {"bare": lambda a: advance(bare.rows, bare.shared, a), "gym": ours.step}
    found: dict[str, list[float]] = {name: [] for name in lanes}
    for turn in range(SPELLS + 1):
        for name, step in lanes.items():
            rate = spell(step, actions, seconds / (2 * SPELLS))
            if turn > 0:  # the first spell compiles
                found[name].append(rate)
    return statistics.median(found["bare"]), statistics.median(found["gym"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=4096)
    parser.add_argument("--seconds", type=float, default=12.0)
    options = parser.parse_args()
    for stage in ("state", "vision"):
        bare, ours = measure(stage, options.count, options.seconds)
        print(
            f"  N = {options.count}  {stage:7s} bare {bare / 1e3:6.0f} k/s  gym {ours / 1e3:6.0f} k/s  "
            f"ratio {ours / bare:.3f} (mark 0.95)"
        )


if __name__ == "__main__":
    main()
