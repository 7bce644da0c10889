"""Flights in lockstep: how many times faster than real time one runs, which node takes how much of it, and how long a
campaign takes.

Real-time factor: virtual seconds over wall seconds from the moment the car sets off to the end of the run, the slowest
part (camera and detector work from there on). The share of each node is measured in the same flights.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from hil.assembly.plan import Plan
from hil.campaign.flying import Flying
from hil.campaign.grid import Grid, check
from hil.campaign.workers.pool import Pool
from hil.host import lockstep
from hil.host.flight import fly
from hil.recording import provenance
from scenarios.spec import list_scenarios, load


class _Timed:
    """A node whose steps are timed."""

    def __init__(self, node, spent: dict[str, float]) -> None:
        self._node, self._spent = node, spent
        for field in ("name", "inputs", "outputs", "wakes", "period_ns", "lookahead_ns"):
            setattr(self, field, getattr(node, field))

    def step(self, now_ns, inbox):
        begun = time.thread_time()  # pictures are drawn on a thread of their own
        outs = self._node.step(now_ns, inbox)
        self._spent[self.name] += time.thread_time() - begun
        return outs


def real_time_factors(scenario: str, camera: str, seeds: Sequence[int]) -> tuple[list[float], dict[str, float]]:
    """Real-time factor of each seed, and each node's share (%) of the steps and the recording of all of them. The first
    seed is flown once more before, to warm up."""
    spent: dict[str, float] = defaultdict(float)
    plain = lockstep.Lockstep.__init__

    def timed(self, nodes, clock, tap, **options):
        def timed_tap(now_ns, topic, message):
            begun = time.thread_time()
            tap(now_ns, topic, message)
            spent["recording and scoring"] += time.thread_time() - begun

        plain(self, [_Timed(node, spent) for node in nodes], clock, timed_tap, **options)

    plan, code = Plan(scenario, "sim", None, camera), provenance.code()
    lockstep.Lockstep.__init__ = timed
    factors: list[float] = []
    try:
        with tempfile.TemporaryDirectory() as folder:
            for turn, seed in enumerate((seeds[0], *seeds)):
                if turn == 1:
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
    return factors, {name: 100 * seconds / total for name, seconds in sorted(spent.items(), key=lambda one: -one[1])}


def campaign_seconds(flights: int, camera: str = "pictures") -> float:
    """Seconds of a campaign of `flights` (a multiple of 6) over the published scenarios, a process a core, its start
    included."""
    names = tuple(name for name in list_scenarios() if load(name).published)
    with tempfile.TemporaryDirectory() as folder:
        grid = Grid(names, ("vision",), range(flights // len(names)), "sim", camera, "none", Path(folder))
        begun = time.perf_counter()
        jobs = check(grid)
        for result in Pool(os.cpu_count() or 1).each(Flying.of(grid, jobs, provenance.code()), jobs):
            if result.failure:
                raise RuntimeError(f"{result.job}: {result.failure}")
        return time.perf_counter() - begun
