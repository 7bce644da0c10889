"""Car room: what kernels, follower, driver and simulated car cost, and how fast the car drives what Hard-I asks.

python -m benchmarks.bench_groundcar
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from groundcar.motion import board_motion as m
from groundcar.motion import paths as t
from groundcar.motion import speed_laws as s
from groundcar.motion.splines import random_spline
from groundcar.scout.driver import Command, ScoutLink
from groundcar.scout.follower import Follower
from groundcar.scout.sim import ScoutSim
from hil.contract.wire import memory_pair
from kernel.jit import njit
from kernel.random import stream

MS = 1_000_000


@njit(cache=False)
def _splines(rng, path, v, n):
    for _ in range(n):
        random_spline(rng, path, v)


@njit(cache=False)
def _steps(row, aux, rng, n):
    for _ in range(n):
        m.motion_step(row, aux, 0.01, rng)


@njit(cache=False)
def _futures(row, aux, out, n):
    for _ in range(n):
        m.motion_future(row, aux, 0.05, 15, out)


def microseconds(run: Callable[[int], None], n: int) -> float:
    """Process-CPU time of one of `n` in a call of `run(n)`, best of three."""
    run(1)
    best = math.inf
    for _ in range(3):
        start = time.process_time()
        run(n)
        best = min(best, time.process_time() - start)
    return best / n * 1e6


def spline(seed: int, v_des: float) -> np.ndarray:
    path = t.static_path()
    random_spline(stream(seed, 1), path, v_des)
    return path


def hard_i(seed: int, seconds: float = 20.0) -> tuple[float, float, float, float]:
    """(lowest, highest speed, largest distance from the reference, CPU seconds) after a run-up of 4 s."""
    now = [0]
    ours, theirs = memory_pair(lambda: now[0], MS)
    follower = Follower(m.motion_aux(t.SPLINE, spline(seed, 2.5), s.COSINE, s.cosine_speed()), 0.0, stream(seed, 2))
    car, link = ScoutSim(theirs, seed=seed, pose=follower.start_pose), ScoutLink(ours)
    follower.start(500 * MS)
    speeds, away, start = [], [], time.process_time()
    command: Command | None = None
    for now[0] in range(0, round(seconds * 1e9), 4 * MS):
        car.step(now[0])
        if now[0] % (20 * MS) == 0:
            ref, command = follower.step(now[0], *car.pose, car.speed, car.turn_rate)
            link.step(now[0], command)
            if now[0] > 4500 * MS:
                away.append(math.hypot(ref.x - car.pose.x, ref.y - car.pose.y))
        if now[0] > 4500 * MS:
            speeds.append(car.speed)
    return min(speeds), max(speeds), max(away), time.process_time() - start


def run() -> dict[str, float]:
    """Microseconds of kernels and of one follower step, milliseconds of the closed loop, m/s and m of Hard-I."""
    path, rng, found = t.static_path(), stream(1), {}
    for v in (1.0, 2.0, 2.5, 3.2):
        found[f"random_spline at {v} m/s, us"] = microseconds(lambda n, v=v: _splines(rng, path, v, n), 2000)
    aux, row, out = m.motion_aux(t.SPLINE, path, s.OU, s.ou_speed(2.0)), np.zeros(8), np.zeros((15, 8))
    m.motion_reset(row, aux, 0.0, 1.5, 0.6, True)
    found["motion_step, us"] = microseconds(lambda n: _steps(row, aux, rng, n), 20_000)
    found["motion_future, 15 states, us"] = microseconds(lambda n: _futures(row, aux, out, n), 2000)
    follower = Follower(aux, 0.0, rng)
    follower.start(0)
    clock = iter(range(0, 10**15, 20 * MS))

    def follow(n: int) -> None:
        for _ in range(n):
            follower.step(next(clock), 0.0, 0.0, 0.0, 0.0, 0.0)

    found["Follower.step, us"] = microseconds(follow, 500)
    low, high, away, cost = np.array([hard_i(seed) for seed in range(10)]).T
    found["car, wire, driver, follower: ms CPU a simulated second"] = cost.mean() / 20.0 * 1e3
    found["Hard-I lowest speed, mean of 10 seeds (published 0.70)"] = low.mean()
    found["Hard-I lowest speed, smallest"], found["Hard-I lowest speed, largest"] = low.min(), low.max()
    found["Hard-I highest speed, mean of 10 seeds (published 2.70)"] = high.mean()
    found["Hard-I highest speed, smallest"], found["Hard-I highest speed, largest"] = high.min(), high.max()
    found["Hard-I farthest from the reference, m"] = away.max()
    return {name: float(value) for name, value in found.items()}


if __name__ == "__main__":
    for name, value in run().items():
        print(f"{name:60s} {value:8.3f}")
