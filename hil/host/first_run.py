"""The first run on a machine: its cores compile the kernels together, each those of other services."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from typing import Any, NamedTuple

from hil.assembly.node_table import NODES, service_nodes
from hil.assembly.plan import Plan
from hil.host.warm_up import warm_up
from kernel.interrupts import interrupts_blocked
from kernel.jit import is_compiled, keeps_compiled
from policies.estimation.board_ekf import belief_update
from scenarios.draw import draw

# Those that compile longest begin; the camera, whose picture the detector needs, long before the detector.
_ORDER = ("vehicle_link", "brain", "camera", "car", "detector")


class Wanted(NamedTuple):
    """What `Plan` is made of: names or paths; None: the scenario's or the rig's."""

    scenario: str
    rig: str | None
    policy: str | None
    camera: str | None


def is_first_run() -> bool:
    """Whether a flight would have to compile its kernels: on a new machine, or after a change of their source."""
    return keeps_compiled() and not is_compiled(belief_update)  # which every rig's belief runs


def compile_kernels(wanted: Sequence[Wanted]) -> None:
    """Compile what the runs `wanted` need, on all cores that this process may use.

    What is compiled already is only loaded. If a helping process dies, the flight compiles what it owed.
    """
    shares = [(one, names) for one in wanted for names in _shares(one)]
    context = multiprocessing.get_context("spawn")
    taken = context.Value("i", 0)
    count = min(len(os.sched_getaffinity(0)), len(shares)) - 1
    helpers = [context.Process(target=_work, args=(shares, taken), daemon=True) for _ in range(count)]
    try:
        with interrupts_blocked():  # Ctrl-C ends the run, which ends its helpers
            for helper in helpers:
                helper.start()
        _work(shares, taken)
        for helper in helpers:
            helper.join()
    finally:
        for helper in helpers:
            if helper.pid:  # it was started
                helper.kill()


def _plan(wanted: Wanted) -> Plan:
    return Plan(wanted.scenario, wanted.rig, wanted.policy, wanted.camera, live=True)


def _shares(wanted: Wanted) -> list[tuple[str, ...]]:
    """The services' nodes. A device simulated here is stepped with its driver, so it has no share of its own."""
    services = service_nodes(_plan(wanted).rig)
    names = sorted(services, key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))
    return [services[name] for name in names if not all(NODES[node].simulates for node in services[name])]


def _work(shares: list[tuple[Wanted, tuple[str, ...]]], taken: Any) -> None:
    """Take one share after the other until none is left."""
    while True:
        with taken.get_lock():
            mine = taken.value
            taken.value += 1
        if mine >= len(shares):
            return
        wanted, names = shares[mine]
        plan = _plan(wanted)
        warm_up(plan, draw(plan.scenario, 0), names)
