"""`make bench`: what this project costs on the machine at hand, beside its marks, and how costs grow with their size.

    python -m benchmarks [--out results/bench.json]

Medians and ratios, never asserted anywhere; with the load of the machine, because on a busy one they mean little. The
peer is measured in the same run if `make peer` has installed it. What one part costs in
detail: the other modules of this folder, each by itself.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np

from benchmarks import bench_env, bench_growth, bench_lockstep, bench_policy
from policies.flying.registry import policy_factory
from vehicle.quadrotor.airframe import load_airframe

OUT = Path(__file__).parents[1] / "results" / "bench.json"
_COLD = """
import numpy as np
from policies.environment.config import EnvConfig
from policies.environment.env import Env
env = Env(EnvConfig(stage="vision", count=2))
env.reset()
env.step(np.zeros((2, 4)))
"""


@dataclass(frozen=True)
class Sizes:
    """How much is measured. `growth`: rows, seconds recorded, runs, seeds."""

    seeds: Sequence[int] = (0, 1, 2)
    cameras: Sequence[str] = ("pictures", "model")
    rows: int = 4096
    seconds: float = 3.0
    ticks: int = 4000
    flights: int = 120
    cold: bool = True
    growth: tuple[Sequence[int], ...] = bench_growth.SIZES


@dataclass(frozen=True)
class Row:
    """One figure. `mark`: what it should reach; for `less` it is a bound from above. `samples`: what it is the median
    of, if of several."""

    what: str
    value: float | None  # None: not measured here
    unit: str
    mark: float | None = None
    aim: float | None = None
    less: bool = False
    samples: tuple[float, ...] = ()

    @property
    def met(self) -> bool | None:
        """Whether it reaches its mark; None without one or the other."""
        if self.value is None or self.mark is None:
            return None
        return self.value <= self.mark if self.less else self.value >= self.mark

    def line(self) -> str:
        """For a terminal."""
        value, mark, aim = (_shown(number) for number in (self.value, self.mark, self.aim))
        word = {True: "met", False: "missed", None: ""}[self.met]
        return f"{self.what:58s} {value:>8s} {self.unit:8s} {mark:>6s} {aim:>6s}  {word}"


def _shown(number: float | None) -> str:
    return "-" if number is None else f"{number:.3g}" if number < 1000 else f"{number:.0f}"


def environment(sizes: Sizes, peer: dict[str, bench_env.Rate] | None) -> Iterator[Row]:
    """Control steps a second of vehicle and environment, against the peer's, and what more threads bring."""
    threads = numba.config.NUMBA_NUM_THREADS
    every = bench_env.measure(sizes.rows, sizes.seconds, threads)
    one = bench_env.measure(sizes.rows, sizes.seconds, 1) if threads > 1 else every
    for name, mark, aim in (("vehicle", 10.0, None), ("state", 2.0, 10.0), ("vision", 1.0, 3.0)):
        wall, theirs = every[name][0], peer["vehicle" if name == "vehicle" else "gym"][0] if peer else None
        yield Row(f"{name}, {threads} threads", wall / 1e3, "k/s")
        yield Row(f"{name} against crazyflow's", wall / theirs if theirs else None, "x", mark, aim)
    scales = 1.8 if threads == 2 else 0.7 * threads
    for name in ("state", "vision"):
        yield Row(f"{name}, {threads} threads against one", every[name][0] / one[name][0], "x", scales)


def tick(sizes: Sizes) -> Iterator[Row]:
    """What one tick of the policy that flies unless told otherwise takes."""
    policy = policy_factory("vision", load_airframe("paper_quad"))()
    bench_policy.ticks(policy, 300)
    wall = bench_policy.ticks(policy, sizes.ticks)[:, :2].sum(1) * 1e-3
    for percent, mark in ((50, 0.10), (99, 0.20)):
        yield Row(f"a policy's tick, vision, p{percent}", float(np.percentile(wall, percent)), "ms", mark, less=True)


def cold_seconds() -> float:
    """Seconds in which a new process compiles the kernels of the vision environment."""
    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        environment = {**os.environ, "PERCH_KERNEL_CACHE": folder}
        subprocess.run([sys.executable, "-c", _COLD], check=True, env=environment, cwd=OUT.parents[1])
        return time.perf_counter() - begun


def rows(sizes: Sizes, found: dict[str, Any]) -> Iterator[Row]:
    """Every figure; shares and growth go into `found`."""
    for camera, mark, aim in (("pictures", 4.0, 8.0), ("model", 15.0, 25.0)):
        if camera in sizes.cameras:
            factors, found["shares"][camera] = bench_lockstep.real_time_factors("hard-i", camera, sizes.seeds)
            what = f"lockstep, hard-i, camera {camera}, real-time factor"
            yield Row(what, statistics.median(factors), "x", mark, aim, samples=tuple(factors))
    if sizes.flights:
        seconds = bench_lockstep.campaign_seconds(sizes.flights)
        yield Row(f"campaign, {sizes.flights} flights with pictures", seconds, "s", sizes.flights, less=True)
    yield from environment(sizes, found["peer"])
    yield from tick(sizes)
    if sizes.cold:
        yield Row("cold kernels, vision environment", cold_seconds(), "s", 15.0, less=True)
    grown = bench_growth.measure(*sizes.growth)
    found["growth"] = [one.as_dict() for one in grown]
    report = next(one for one in grown if one.peak_mb)
    half_hour = report.sizes[-1] == 1800
    what = f"report of {report.sizes[-1]} s recorded"
    yield Row(what, report.seconds[-1], "CPU s", 15.0 if half_hour else None, less=True)
    yield Row(f"{what}, memory", report.peak_mb[-1], "MB", 500.0 if half_hour else None, less=True)


def machine() -> dict[str, Any]:
    """What it is measured on."""
    try:
        info = Path("/proc/cpuinfo").read_text()
        model = next(line.split(":")[1].strip() for line in info.splitlines() if line.startswith("model name"))
    except (OSError, StopIteration):
        model = platform.processor()
    return {
        "cpu": model,
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "numba": numba.__version__,
    }


def bench(sizes: Sizes) -> dict[str, Any]:
    """Measure and print; the table for JSON."""
    before = os.getloadavg()
    found: dict[str, Any] = {"machine": machine(), "peer": None, "shares": {}, "growth": []}
    print(", ".join(f"{name} {value}" for name, value in found["machine"].items()))
    print(f"load average {before[0]:.1f} before the start", flush=True)
    found["peer"] = bench_env.measure_peer(bench_env.PEER_PYTHON, sizes.rows, sizes.seconds)
    print(f"{'':58s} {'now':>8s} {'':8s} {'mark':>6s} {'aim':>6s}")
    measured = []
    for row in rows(sizes, found):
        measured.append(row)
        print(row.line(), flush=True)
    found["rows"] = [{**asdict(row), "met": row.met} for row in measured]
    found["load"] = {"before": before, "after": os.getloadavg()}
    for camera, shares in found["shares"].items():
        print(f"time by node, camera {camera}: " + ", ".join(f"{name} {share:.1f} %" for name, share in shares.items()))
    for one in found["growth"]:
        print(bench_growth.line(one))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=OUT)
    out: Path = parser.parse_args().out
    found = bench(Sizes())
    out.write_text(json.dumps(found, indent=2, allow_nan=False) + "\n")
    print(f"written to {out}")


if __name__ == "__main__":
    main()
