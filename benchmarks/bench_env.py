"""Control steps a second of the training environment and of its parts, on all cores and on one.

    python -m benchmarks.bench_env [--count 4096] [--seconds 3]

One control step is 10 ms. `vehicle`: body-rate control, mixer, motors and rigid body in 5 substeps of 2 ms; `state` and
`vision` are whole environment steps: board motion, delays, physics, contact, reward, observation, resets, and in
vision camera, noise and filter. The peer is crazyflow 0.4 (first principles + body-rate control, 5 x 500 Hz substeps)
and its LandingEnv: measured in the same run if `make peer` has installed it; else figures that were measured elsewhere,
on two shared cores at N = 4096, are shown. Mark: ten times its control steps a second.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np

from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from vehicle.quadrotor import order_row
from vehicle.quadrotor.airframe import load_airframe
from vehicle.quadrotor.batch import fly_rows
from vehicle.quadrotor.dynamics import vehicle_row

Rate = tuple[float, float]  # control steps a second, and a CPU second: what a busy machine leaves comparable
PEER = {"vehicle": (276_345.0, float("nan")), "gym": (102_000.0, float("nan"))}  # at N = 4096, elsewhere
PEER_PYTHON = Path(__file__).parents[1] / ".venv" / "peer" / "bin" / "python"


def rate(step: Callable[[], None], count: int, seconds: float) -> Rate:
    """Rates of `step`, which advances `count` rows by one; the best of three spells."""
    step()
    wall = cpu = 0.0
    for _ in range(3):
        begun, used, steps = time.perf_counter(), time.process_time(), 0
        while time.perf_counter() - begun < seconds / 3.0:
            step()
            steps += 1
        wall = max(wall, steps * count / (time.perf_counter() - begun))
        cpu = max(cpu, steps * count / (time.process_time() - used))
    return wall, cpu


def _advance(env: Env, actions: np.ndarray) -> None:
    env.step(actions)
    env.tally.__init__()


def measure(count: int, seconds: float, threads: int) -> dict[str, Rate]:
    """Rates of the vehicle alone and of the environment's stages."""
    numba.set_num_threads(threads)
    airframe = load_airframe("paper_quad")
    hover = vehicle_row((0.0, 0.0, 2.0), motor=airframe.hover_thrust)
    rows, params = np.tile(hover, (count, 1)), np.tile(airframe.params_row(), (count, 1))
    orders = np.zeros((count, order_row.DIM))
    orders[:, order_row.NEWER : order_row.NEWER + 3] = np.random.default_rng(0).normal(0.0, 0.3, (count, 3))
    orders[:, order_row.NEWER + 3] = 9.8
    rates = {"vehicle": rate(lambda: fly_rows(rows, orders, params, TICK, 5), count, seconds)}
    actions = np.random.default_rng(1).normal(0.0, 0.1, (count, 4))
    for stage in ("state", "vision"):
        env = Env(EnvConfig(stage=stage, count=count, seed=1, horizon=80, future_stride=5))
        env.reset()
        rates[stage] = rate(lambda env=env: _advance(env, actions), count, seconds)
    return rates


def measure_peer(python: Path, count: int, seconds: float) -> dict[str, Rate] | None:
    """The peer's rates here and now, or None where it is not installed or fails."""
    if not python.exists():
        return None
    command = [str(python), str(Path(__file__).with_name("peer_crazyflow.py")), str(count), str(seconds)]
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo leaves a log where it runs
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    if done.returncode != 0:
        print(f"  peer failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
        return None
    return json.loads(done.stdout.strip().splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=4096)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--peer", type=Path, default=PEER_PYTHON, help="python of a virtual environment with crazyflow")
    options = parser.parse_args()
    cores = numba.config.NUMBA_NUM_THREADS
    print(f"N = {options.count}, {cores} threads available, load average {os.getloadavg()[0]:.1f} before the start")
    found = measure_peer(options.peer, options.count, options.seconds)
    peer, where = (found, "now, all cores") if found else (PEER, "elsewhere, N = 4096; `make peer` installs it")
    print(f"  k control steps a second (and a CPU second); crazyflow 0.4: {where}")
    for name, (wall, cpu) in peer.items():
        print(f"  crazyflow    {name:8s} {wall / 1e3:7.0f} ({cpu / 1e3:.0f})")
    for threads in sorted({1, cores}):
        for name, (wall, cpu) in measure(options.count, options.seconds, threads).items():
            theirs = peer["vehicle" if name == "vehicle" else "gym"]
            times = f"{wall / theirs[0]:5.1f} x crazyflow ({cpu / theirs[1]:.1f} x)"
            print(f"  {threads} thread(s)  {name:8s} {wall / 1e3:7.0f} ({cpu / 1e3:.0f})   {times}")


if __name__ == "__main__":
    main()
