"""Scenarios x policies x seeds, and which of them a folder holds already: those are not flown again."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from hil.assembly.plan import Plan, rig_policy
from hil.assembly.rig import Rig
from hil.recording.manifest import nested
from hil.recording.runs import RunError, list_runs, policy_identity
from kernel.toml_errors import ConfigError
from policies.flying.registry import PolicyFactory
from scenarios.draw import MAX_SEED
from scenarios.faults import FaultFile, FaultTable


@dataclass(frozen=True)
class Grid:
    """What is to be flown. `rig` and `camera` as for a single run (no `rig`: each scenario's own); `pictures`: which to
    record."""

    scenarios: tuple[str, ...]
    policies: tuple[str, ...]
    seeds: range
    rig: str | None
    camera: str | None
    pictures: str
    out: Path
    faults: tuple[FaultTable, ...] = ()  # each name is flown by itself; none: flights without faults
    keep: str = "all"  # which recordings: all, or those of unsafe flights

    @property
    def cases(self) -> dict[str, tuple[FaultTable, ...]]:
        """Name of a fault -> the tables that are flown together."""
        return FaultFile(fault=self.faults).cases if self.faults else {"": ()}


@dataclass(frozen=True)
class Job:
    """One flight of a grid."""

    scenario: str
    policy: str
    seed: int
    fault: str = ""

    @property
    def case(self) -> tuple[str, str, str]:
        """What is flown, whatever the seed."""
        return self.scenario, self.policy, self.fault


@dataclass(frozen=True)
class Result:
    """What became of a job. `failure`: why there was no attempt, empty where a fault was the reason."""

    job: Job
    verdict: str = ""  # one word of `hil.scoring.verdict`
    reasons: tuple[str, ...] = ()
    failure: str = ""
    flight_class: str = ""  # one of `hil.scoring.flight_class`


def check(grid: Grid) -> list[Job]:
    """Every job, scenario by scenario and seed by seed, so that a campaign cut short still compares policies; with
    faults seed by seed.

    Raises ConfigError, ContractError or ValueError for anything that could not be flown: nothing is written before.
    """
    if grid.seeds[-1] > MAX_SEED:
        raise ConfigError(f"seed {grid.seeds[-1]} is out of range: use 0 to {MAX_SEED}")
    for kind, names in (("scenario", grid.scenarios), ("policy", grid.policies)):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ConfigError(f"{kind} {', '.join(twice)} is given twice")
    for scenario, policy in itertools.product(grid.scenarios, grid.policies):
        for case in grid.cases:
            plan = plan_of(grid, Job(scenario, policy, 0, case))
            if not plan.rig.simulated:
                raise ConfigError(
                    f'rig "{plan.rig_name}" has real devices: a campaign repeats seeds, which only simulation can'
                )
    if grid.faults:
        every = itertools.product(grid.seeds, grid.scenarios, grid.cases, grid.policies)
        return [Job(scenario, policy, seed, case) for seed, scenario, case, policy in every]
    return [Job(s, p, seed) for s, seed, p in itertools.product(grid.scenarios, grid.seeds, grid.policies)]


def left_to_do(grid: Grid, jobs: Sequence[Job]) -> list[Job]:
    """The jobs without a finished run in the folder: of the same scenario, rig and policy to the last value."""
    flown = set()
    for run in list_runs(grid.out):
        try:
            manifest, score = run.manifest, run.score
        except RunError:
            continue
        if score is None:
            continue
        decided = manifest.get("state") == "finished" and score.get("outcome") != "incomplete"
        if decided or (nested(manifest, "scenario").get("fault") and nested(score, "flight")):
            flown.add(_key(*(manifest.get(name) for name in ("scenario", "rig", "policy", "seed"))))
    return [job for job in jobs if _wanted(grid, job) not in flown]


def _wanted(grid: Grid, job: Job) -> str:
    plan = plan_of(grid, job)
    scenario = {**plan.scenario.model_dump(mode="json"), "name": plan.scenario.name}
    rig = {**plan.rig.model_dump(mode="json"), "name": Path(plan.rig_name).stem}
    return _key(scenario, rig, policy_identity(plan.policy_name), job.seed)


def _key(scenario: Any, rig: Any, policy: Any, seed: Any) -> str:
    policy = {**policy, "path": ""} if isinstance(policy, dict) else policy  # a file is what it holds
    return repr([_sorted(part) for part in (scenario, rig, policy, seed)])


def _sorted(value: Any) -> Any:
    if isinstance(value, dict):
        return [(key, _sorted(value[key])) for key in sorted(value)]
    return [_sorted(part) for part in value] if isinstance(value, list | tuple) else value


def plan_of(grid: Grid, job: Job) -> Plan:
    """What a job flies, read and checked once. Raises ConfigError, ContractError or ValueError."""
    return _plan(job.scenario, grid.rig, job.policy, grid.camera, grid.cases[job.fault])


@lru_cache(maxsize=512)
def _plan(scenario: str, rig: str | None, policy: str, camera: str | None, faults: tuple[FaultTable, ...]) -> Plan:
    return Plan(scenario, rig, policy, camera, faults=faults, policy_of=shared_policy)


def shared_policy(name: str, rig: Rig) -> PolicyFactory:
    """`rig_policy`, opened once in this process: a network takes 10 MB, and a grid has hundreds of plans for it."""
    key: Any = rig  # frozen, so that it can be one
    return _opened(name, key)


@lru_cache(maxsize=64)
def _opened(name: str, rig: Rig) -> PolicyFactory:
    return rig_policy(name, rig)
