"""Scenarios x policies x seeds, flown in a pool of processes into one folder.

What the folder holds already is not flown again.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba

from hil.assembly.plan import Plan
from hil.host.flight import fly
from hil.live.process import die_with_parent
from hil.recording.autopilot_parameters import note_parameters
from hil.recording.manifest import nested
from hil.recording.provenance import Code, ProvenanceError
from hil.recording.recorder import RecordingError
from hil.recording.runs import RunError, list_runs, policy_identity
from hil.scoring.flight_class import UNSAFE
from hil.wires import WireError
from kernel.toml_errors import ConfigError
from scenarios.draw import MAX_SEED
from scenarios.faults import FaultFile, FaultTable


class CampaignError(RuntimeError):
    """The campaign cannot go on; what was flown is kept."""


@dataclass(frozen=True)
class Grid:
    """What is to be flown. `rig` and `camera` as for a single run; `pictures`: which to record."""

    scenarios: tuple[str, ...]
    policies: tuple[str, ...]
    seeds: range
    rig: str
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
            if not _plan_of(grid, Job(scenario, policy, 0, case)).rig.simulated:
                raise ConfigError(
                    f'rig "{grid.rig}" has real devices: a campaign repeats seeds, which only simulation can'
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


def fly_all(grid: Grid, jobs: Sequence[Job], processes: int, code: Code) -> Iterator[Result]:
    """Fly in `processes` processes; results as they come.

    A KeyboardInterrupt ends the flights under way, closes their recordings and passes through. Raises CampaignError
    if a process dies. For the main thread.
    """
    asked: list[int] = []

    def interrupt(number: int, _: object) -> None:
        asked.append(number)  # an exception out of a signal is lost if it meets a callback or a destructor
        raise KeyboardInterrupt

    context = multiprocessing.get_context("spawn")
    count = min(processes, len(jobs))
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(os.getpid(),))
    before = signal.signal(signal.SIGINT, interrupt)
    try:
        waiting: list[Future[Result | None]] = [pool.submit(_fly, grid, job, code) for job in jobs]
        for done in as_completed(waiting):
            result = done.result()
            if result is None or asked:
                raise KeyboardInterrupt
            yield result
    except BrokenProcessPool:
        raise CampaignError(
            "a flight's process died (out of memory? then use fewer --jobs); the same command goes on from here"
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        signal.signal(signal.SIGINT, before)


def _begin(campaign: int) -> None:
    if not die_with_parent(campaign):
        os._exit(1)  # killed already: nobody waits for what would be flown here
    numba.set_num_threads(1)  # the processes are the threads
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # but for a flight's duration


def _fly(grid: Grid, job: Job, code: Code) -> Result | None:
    """In a process of the pool; None if it was interrupted."""
    plan = _plan_of(grid, job)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        flight = fly(
            plan.scenario, plan.rig, plan.make_policy(), job.seed,
            policy_name=plan.policy_name, rig_name=Path(grid.rig).stem, pictures=grid.pictures, out=grid.out,
            code=code, progress=lambda *_: None, clearance={"kind": "simulated"},
        )  # fmt: skip
        if flight.interrupted:
            return None
        note_parameters(flight.run)
        found = flight.flight_class.name if flight.flight_class else ""
        if grid.keep == "unsafe" and found != UNSAFE:
            for path in flight.run.path.glob("*.mcap"):
                path.unlink()
    except (RunError, RecordingError, ProvenanceError, WireError) as error:
        return Result(job, failure=str(error))
    except KeyboardInterrupt:
        return None
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    score = flight.score
    failure = "" if plan.scenario.fault and found else flight.failure
    return Result(job, score.verdict, tuple(score.reasons), failure, found)


def _wanted(grid: Grid, job: Job) -> str:
    plan = _plan_of(grid, job)
    scenario = {**plan.scenario.model_dump(mode="json"), "name": plan.scenario.name}
    rig = {**plan.rig.model_dump(mode="json"), "name": Path(grid.rig).stem}
    return _key(scenario, rig, policy_identity(plan.policy_name), job.seed)


def _key(scenario: Any, rig: Any, policy: Any, seed: Any) -> str:
    policy = {**policy, "path": ""} if isinstance(policy, dict) else policy  # a file is what it holds
    return repr([_sorted(part) for part in (scenario, rig, policy, seed)])


def _sorted(value: Any) -> Any:
    if isinstance(value, dict):
        return [(key, _sorted(value[key])) for key in sorted(value)]
    return [_sorted(part) for part in value] if isinstance(value, list | tuple) else value


def _plan_of(grid: Grid, job: Job) -> Plan:
    return _plan(job.scenario, grid.rig, job.policy, grid.camera, grid.cases[job.fault])


@lru_cache(maxsize=512)
def _plan(scenario: str, rig: str, policy: str, camera: str | None, faults: tuple[FaultTable, ...]) -> Plan:
    return Plan(scenario, rig, policy, camera, faults=faults)
