"""Flights a minute on a Ray cluster of this machine's cores against the process pool, in turn, and what a flight costs
the machine that started the campaign.

    python -m benchmarks.bench_cluster [--flights 24] [--rounds 3] [--cores 2] [--camera model]

Rates count from the moment at which every worker has delivered a flight: starting takes seconds on both. Mark: 0.9 of
the pool's flights a minute.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import tempfile
import time
from pathlib import Path

from hil.campaign.flying import Flying
from hil.campaign.grid import Grid, check
from hil.campaign.workers.cluster import connected
from hil.campaign.workers.pool import Pool
from hil.campaign.workers.work import Workers
from hil.recording.provenance import code

TICKS = os.sysconf("SC_CLK_TCK")


def cpu_of(pids: list[int]) -> float:
    """CPU seconds of other processes so far (proc(5), /proc/pid/stat, fields 14 and 15)."""
    total = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        total += int(fields[11]) + int(fields[12])
    return total / TICKS


def fly(workers: Workers, cores: int, flights: int, camera: str, services: list[int]) -> dict[str, float]:
    """One campaign of `flights` into a new folder; `services`: process ids of the cluster's own processes."""
    out = Path(tempfile.mkdtemp(prefix="bench-"))
    try:
        grid = Grid(("simple-i",), ("planner-analytic",), range(flights), "sim", camera, "none", out)
        jobs, begun, first, warm, last = check(grid), time.perf_counter(), 0.0, 0, 0.0
        used, at = (0.0, 0.0), 0.0
        for done, result in enumerate(workers.each(Flying.of(grid, jobs, code()), jobs), 1):
            assert not result.failure, result
            last = time.perf_counter()
            first = first or last - begun
            if done == 2 * cores:
                warm, at, used = done, last, (time.process_time(), cpu_of(services))
        counted = flights - warm
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file()) / flights
        return {
            "flights a minute": 60.0 * counted / (last - at),
            "s to the first flight": first,
            "CPU ms a flight, this process": 1e3 * (time.process_time() - used[0]) / counted,
            "CPU ms a flight, the cluster's services": 1e3 * (cpu_of(services) - used[1]) / counted,
            "kB a flight": size / 1e3,
        }
    finally:
        shutil.rmtree(out, ignore_errors=True)


def main() -> None:
    """Print medians of the rounds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("flights", 24), ("rounds", 3), ("cores", 2)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--camera", choices=("model", "pictures"), default="model")
    asked = parser.parse_args()
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": asked.cores, "include_dashboard": False})
    found: dict[str, list[dict[str, float]]] = {"pool": [], "cluster": []}
    try:
        head = cluster.head_node
        assert head is not None
        services = [info.process.pid for kind in head.all_processes.values() for info in kind]
        for _ in range(asked.rounds):
            found["pool"].append(fly(Pool(asked.cores), asked.cores, asked.flights, asked.camera, []))
            with connected(cluster.address, None) as workers:
                found["cluster"].append(fly(workers, asked.cores, asked.flights, asked.camera, services))
    finally:
        cluster.shutdown()
    print(f"{asked.rounds} rounds of {asked.flights} flights on {asked.cores} cores, camera {asked.camera}; medians")
    for name in found["pool"][0]:
        pool, ray = (statistics.median(one[name] for one in found[kind]) for kind in ("pool", "cluster"))
        print(f"{name:40s} pool {pool:9.2f}   cluster {ray:9.2f}   ratio {ray / pool if pool else float('nan'):5.2f}")


if __name__ == "__main__":
    main()
