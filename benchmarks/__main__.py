"""`make bench`: every figure of this project on the machine at hand; medians and ratios, never asserted anywhere.

Real-time factor: virtual seconds over wall seconds from the moment the car sets off to the end of the run, the slowest
part (camera and detector work from there on). The share of each node is measured in the same run.
"""

from __future__ import annotations

import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

from hil.assembly.plan import Plan
from hil.host import lockstep
from hil.host.flight import fly
from hil.recording import provenance

SEEDS = (0, 1, 2)


class _Timed:
    """A node whose steps are timed."""

    def __init__(self, node, spent: dict[str, float]) -> None:
        self._node, self._spent = node, spent
        for field in ("name", "inputs", "outputs", "wakes", "period_ns"):
            setattr(self, field, getattr(node, field))

    def step(self, now_ns, inbox):
        begun = time.perf_counter()
        outs = self._node.step(now_ns, inbox)
        self._spent[self.name] += time.perf_counter() - begun
        return outs


def real_time_factors(scenario: str, camera: str) -> tuple[list[float], dict[str, float]]:
    """Real-time factor of each seed, and each node's share (%) of the wall time of all of them."""
    spent: dict[str, float] = defaultdict(float)
    plain = lockstep.Lockstep.__init__

    def timed(self, nodes, clock, tap):
        def timed_tap(now_ns, topic, message):
            begun = time.perf_counter()
            tap(now_ns, topic, message)
            spent["recording and scoring"] += time.perf_counter() - begun

        plain(self, [_Timed(node, spent) for node in nodes], clock, timed_tap)

    plan = Plan(scenario, "sim", None, camera)
    code = provenance.code()
    lockstep.Lockstep.__init__ = timed
    factors = []
    try:
        with tempfile.TemporaryDirectory() as folder:
            for seed in (SEEDS[0], *SEEDS):  # the first one warms up
                if len(factors) == 1 and seed == SEEDS[0]:
                    spent.clear()
                    factors.clear()
                flight = fly(
                    plan.scenario, plan.rig, plan.make_policy(), seed, policy_name=plan.policy_name, rig_name="sim",
                    pictures="preview", out=Path(folder), code=code, progress=lambda _now, _stage: None,
                )  # fmt: skip
                factors.append(flight.real_time_factor or float("nan"))
    finally:
        lockstep.Lockstep.__init__ = plain
    total = sum(spent.values())
    return factors, {name: 100 * seconds / total for name, seconds in spent.items()}


def _machine() -> str:
    try:
        info = Path("/proc/cpuinfo").read_text()
        model = next(line.split(":")[1].strip() for line in info.splitlines() if line.startswith("model name"))
    except (OSError, StopIteration):
        model = platform.processor()
    return f"{model}, {platform.system()} {platform.release()}, Python {platform.python_version()}"


def main() -> None:
    """Print all figures."""
    print(_machine())
    for scenario, camera, mark in (("hard-i", "pictures", ">= 1, aim 2"), ("hard-i", "model", "aim 10")):
        factors, shares = real_time_factors(scenario, camera)
        print(f"\nreal-time factor, {scenario}, camera {camera}, one thread ({mark}): ", end="")
        print(f"median {statistics.median(factors):.2f} of {', '.join(f'{f:.2f}' for f in factors)}")
        for name, share in sorted(shares.items(), key=lambda item: -item[1])[:8]:
            print(f"    {share:5.1f} %  {name}")
    folder = Path(__file__).parent
    for script in sorted(folder.glob("bench_*.py")):
        print(f"\n{script.stem}", flush=True)
        subprocess.run([sys.executable, str(script)], check=False)


if __name__ == "__main__":
    main()
