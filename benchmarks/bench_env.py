"""Control steps a second of the training environment and of its parts, on all cores and on one.

    python -m benchmarks.bench_env [--count 4096] [--seconds 3]

One control step is 10 ms. `vehicle`: body-rate control, mixer, motors and rigid body in 5 substeps of 2 ms; `state` and
`vision` are whole environment steps: platform motion, delays, physics, contact, reward, observation, resets, and in
vision camera, noise and filter. Peers for comparison, measured elsewhere on two shared cores at N = 4096: crazyflow 0.4
(first principles + body-rate control, 5 x 500 Hz substeps) 276 k control steps/s, its LandingEnv 102 k.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable

import numba
import numpy as np

from kernel import njit, prange
from policies.env import Env
from policies.env_config import TICK, EnvConfig
from vehicle.airframe import load_airframe
from vehicle.dynamics import vehicle_row
from vehicle.rate_control import fly

PEER, PEER_GYM = 276_345, 102_000


@njit(parallel=True)
def _fly_all(rows, commands, params, substeps):
    for i in prange(rows.shape[0]):
        fly(rows[i], commands[i], params, TICK, substeps)


def rate(step: Callable[[], None], count: int, seconds: float) -> float:
    """Control steps a second of `step`, which advances `count` rows by one; the best of three spells."""
    step()
    best = 0.0
    for _ in range(3):
        begun, steps = time.perf_counter(), 0
        while time.perf_counter() - begun < seconds / 3.0:
            step()
            steps += 1
        best = max(best, steps * count / (time.perf_counter() - begun))
    return best


def _advance(env: Env, actions: np.ndarray) -> None:
    env.step(actions)
    env.tally.__init__()


def measure(count: int, seconds: float, threads: int) -> dict[str, float]:
    """Rates of the vehicle alone and of the environment's stages, control steps/s."""
    numba.set_num_threads(threads)
    airframe = load_airframe("paper_quad")
    hover = vehicle_row((0.0, 0.0, 2.0), motor=airframe.hover_thrust)
    rows, params = np.tile(hover, (count, 1)), airframe.params_row()
    commands = np.random.default_rng(0).normal(0.0, 0.3, (count, 4))
    commands[:, 3] = 9.8
    rates = {"vehicle": rate(lambda: _fly_all(rows, commands, params, 5), count, seconds)}
    actions = np.random.default_rng(1).normal(0.0, 0.1, (count, 4))
    for stage in ("state", "vision"):
        env = Env(EnvConfig(stage=stage, count=count, seed=1, horizon=80, future_stride=5))
        env.reset()
        rates[stage] = rate(lambda env=env: _advance(env, actions), count, seconds)
    return rates


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=4096)
    parser.add_argument("--seconds", type=float, default=3.0)
    options = parser.parse_args()
    cores = numba.config.NUMBA_NUM_THREADS
    load = os.getloadavg()[0]
    print(f"N = {options.count}, {cores} threads available, load average {load:.1f} before the start")
    for threads in sorted({1, cores}):
        rates = measure(options.count, options.seconds, threads)
        for name, value in rates.items():
            peer = PEER if name == "vehicle" else PEER_GYM
            print(f"  {threads} thread(s)  {name:8s} {value / 1e3:9.0f} k control steps/s  {value / peer:5.1f} x peer")


if __name__ == "__main__":
    main()
