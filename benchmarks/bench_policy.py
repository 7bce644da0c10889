"""How long one tick of a policy takes, from the belief to the command: one thread, batch 1, as in flight.

    python -m benchmarks.bench_policy [--policy FILE.onnx] [--ticks 4000]

A tick is what a flight does every 10 ms: the detections that have arrived go into the filter, the filter predicts to
now, the policy answers (network: history, observation, ONNX Runtime; planner: prediction, search, tracking). Timed in
closed loop over episodes of the training environment, whose own work is not counted. Mark: p99 < 1 ms on an idle core
(the paper: 1.8 ms for the network on an Orin NX). On a busy machine the wall clock also measures who else ran; the
thread's own CPU time, beside it, does not.
"""

from __future__ import annotations

import argparse
import gc
import os
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from policies.environment.config import EnvConfig
from policies.environment.flight import EnvFlight
from policies.estimation.board_filter import BoardFilter
from policies.flying.registry import policy_factory
from policies.task.interface import FlyingPolicy
from vehicle.quadrotor.airframe import load_airframe

CHECKPOINTS = Path(__file__).parents[1] / "policies" / "checkpoints"


def ticks(policy: FlyingPolicy, count: int) -> np.ndarray:
    """Microseconds of `count` ticks ((count, 3)): the filter's and the policy's of the wall clock, CPU time of both."""
    flight = EnvFlight(EnvConfig(stage="vision", seed=7))
    board, found, fresh = BoardFilter(), np.zeros((count, 3)), True
    for k in range(count):
        if fresh:
            board.reset()
            policy.reset(flight.now_ns)
        arrived, odometry, now = flight.detections(), flight.odometry(), flight.now_ns
        used, begun = time.thread_time_ns(), time.perf_counter_ns()
        for seen in arrived:
            told = seen.exposure_ns, seen.position, seen.orientation, seen.position_sigma, seen.orientation_sigma
            board.update(*told)
        estimate = board.estimate(now)
        middle = time.perf_counter_ns()
        command = policy.step(now, odometry, estimate)
        end = time.perf_counter_ns()
        found[k] = (middle - begun) * 1e-3, (end - middle) * 1e-3, (time.thread_time_ns() - used) * 1e-3
        flight.act(command)
        fresh = flight.done
    return found


def report(name: str, found: np.ndarray) -> str:
    """One line: wall clock and CPU time of a tick, and the medians of its two parts."""
    wall, cpu = np.percentile(found[:, :2].sum(1), (50, 99)), np.percentile(found[:, 2], (50, 99))
    parts = np.median(found, axis=0)
    return (
        f"  {name:18s} p50 {wall[0]:5.0f} us  p99 {wall[1]:5.0f} us   CPU time p50 {cpu[0]:4.0f} us  p99 {cpu[1]:4.0f}"
        f" us   (medians: filter {parts[0]:.0f}, policy {parts[1]:.0f})"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--policy", type=Path, action="append", help="an .onnx file [default: all committed ones]")
    parser.add_argument("--ticks", type=int, default=4000)
    options = parser.parse_args()
    airframe = load_airframe("paper_quad")
    files = options.policy or sorted(CHECKPOINTS.glob("*.onnx"))
    print(f"a policy's tick, load average {os.getloadavg()[0]:.1f} before the start (mark: p99 < 1000 us, idle core)")
    for name in (*map(str, files), "planner", "planner-analytic"):
        policy = policy_factory(name, airframe)()
        ticks(policy, 300)
        gc.disable()
        print(report(Path(name).name, ticks(policy, options.ticks)), flush=True)
        gc.enable()


if __name__ == "__main__":
    main()
