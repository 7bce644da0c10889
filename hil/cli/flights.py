"""Flying one or many seeds from the command line: checks everything first, then flies, prints and counts."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from hil.assembly.plan import Plan
from hil.check.interlock import Clearance, NotClearedError, clear_to_arm
from hil.cli.console import json_row, run_table, seeds_table
from hil.cli.live_times import live_lines
from hil.cli.options import COULD_NOT_RUN, INTERRUPTED, NOT_PERCHED, PERCHED, USAGE
from hil.host.flight import Flight, fly
from hil.live.supervisor import SupervisorError
from hil.recording import provenance
from hil.recording.autopilot_parameters import note_parameters
from hil.recording.recorder import RecordingError
from hil.recording.runs import RunError
from hil.scoring.score import Score
from hil.viewer.view import ViewerError, free_port
from kernel.jit import cache_is_cold
from kernel.toml_errors import ConfigError
from policies.flying.contract import ContractError
from scenarios.draw import MAX_SEED
from scenarios.spec import published_row
from vehicle.quadrotor.airframe import load_airframe

if TYPE_CHECKING:
    from hil.viewer.live import RunViewer
    from hil.viewer.tap import Feed


@dataclass(frozen=True)
class Request:
    """What the command line asked for. `remote`, `endpoint` and `keys` are the live host's."""

    scenario: str
    rig: str
    policy: str | None
    camera: str | None
    pictures: str
    out: Path
    checks: Path
    override: str | None = None
    as_json: bool = False
    live: bool = False
    remote: tuple[str, ...] = ()
    endpoint: str | None = None
    keys: Path | None = None
    view: bool = False


def fly_seeds(request: Request, seeds: Sequence[int]) -> int:
    """Fly every seed and print; returns the exit code of `perch-hil run`."""
    notes = Console(stderr=True)
    try:
        plan = Plan(request.scenario, request.rig, request.policy, request.camera)
        if seeds[-1] > MAX_SEED:
            raise ConfigError(f"seed {seeds[-1]} is out of range: use 0 to {MAX_SEED}")
        if not plan.rig.simulated and not request.live:
            raise ConfigError(f'rig "{request.rig}" has real devices, which keep real time: add --live')
        _check_live(request, plan)
    except (ConfigError, ContractError, ValueError) as error:
        print(f"perch-hil: {error}", file=sys.stderr)
        return USAGE
    if cache_is_cold():
        notes.print("First run on this machine: compiling kernels takes a minute or two, once.", style="yellow")
    flights: list[Flight] = []
    try:
        code = provenance.code()
        clearance = clear_to_arm(
            request.rig, plan.rig, plan.policy_name, plan.scenario,
            folder=request.checks, now=datetime.now(UTC), override=request.override,
        )  # fmt: skip
        with _viewer(request, notes) as viewer:
            for seed in seeds:
                flight, summary = _fly_one(request, plan, seed, code, clearance, notes, viewer)
                flights.append(flight)
                note_parameters(flight.run)
                _print(request, plan, flight, summary, notes, several=len(seeds) > 1)
                if flight.interrupted:
                    break
    except ViewerError as error:
        print(f"perch-hil: {error}", file=sys.stderr)
        return error.code
    except (RunError, RecordingError, NotClearedError, SupervisorError, provenance.ProvenanceError) as error:
        print(f"perch-hil: {error}", file=sys.stderr)
        return COULD_NOT_RUN
    if len(seeds) > 1 and not request.as_json:
        Console().print(seeds_table(plan.scenario, [flight.score for flight in flights]))
    return _exit_code(flights)


def _check_live(request: Request, plan: Plan) -> None:
    """Raises ConfigError or KeysError for options of the live host that do not go together."""
    if not request.live:
        given = [f"--{name}" for name in ("remote", "endpoint", "keys") if getattr(request, name)]
        if given:
            raise ConfigError(f"{', '.join(given)}: only a live run has a bus: add --live")
        return
    from hil.live.options import check_options

    check_options(plan.rig, request.remote, request.endpoint, request.keys, viewed=request.view)


def _exit_code(flights: Sequence[Flight]) -> int:
    if any(flight.interrupted for flight in flights):
        return INTERRUPTED
    if any(flight.failure for flight in flights):
        return COULD_NOT_RUN
    return PERCHED if all(flight.score.verdict == "perched" for flight in flights) else NOT_PERCHED


def _viewer(request: Request, notes: Console) -> AbstractContextManager[RunViewer | None]:
    if not request.view:
        return nullcontext()
    from hil.viewer.live import RunViewer

    return RunViewer(lambda text: notes.print(text, soft_wrap=True, highlight=False))


def _feed(plan: Plan, seed: int, viewer: RunViewer | None, endpoint: str = "") -> AbstractContextManager[Feed | None]:
    if viewer is None:
        return nullcontext()
    mount = load_airframe(plan.rig.vehicle.airframe).camera
    return viewer.feed(
        f"{plan.scenario.name} seed {seed}", board_size=plan.scenario.board.size,
        tolerance=plan.scenario.tolerance.distance, camera_offset=mount.offset,
        camera_tilt=math.radians(mount.tilt_deg), endpoint=endpoint,
    )  # fmt: skip


def _fly_one(
    request: Request,
    plan: Plan,
    seed: int,
    code: provenance.Code,
    clearance: Clearance,
    notes: Console,
    viewer: RunViewer | None,
) -> tuple[Flight, dict[str, Any] | None]:
    """The flight, and how it kept time if it was live."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=notes, transient=True) as bar:
        task = bar.add_task(f"{plan.scenario.name} seed {seed}: starting")

        def progress(now_ns: int, stage: str) -> None:
            bar.update(task, description=f"{plan.scenario.name} seed {seed}: {stage}, {now_ns * 1e-9:.1f} s")

        if not request.live:
            with _feed(plan, seed, viewer) as feed:
                flight = fly(
                    plan.scenario, plan.rig, plan.make_policy(), seed,
                    policy_name=plan.policy_name, rig_name=Path(request.rig).stem, pictures=request.pictures,
                    out=request.out, code=code, clearance=clearance.manifest(), progress=progress, viewer=feed,
                )  # fmt: skip
            if feed is not None and feed.dropped:
                notes.print(f"the viewer was too slow for {feed.dropped} messages; the recording has them all")
            return flight, None
        from hil.live.run import fly_live

        names = {field: getattr(request, field) for field in ("scenario", "rig", "policy", "camera")}
        endpoint = request.endpoint
        if viewer is not None and endpoint is None:
            endpoint = f"tcp/127.0.0.1:{free_port()}"  # the feed must know it before the hub is there
        with _feed(plan, seed, viewer, endpoint or ""):
            live = fly_live(
                plan, names, seed, pictures=request.pictures, out=request.out, code=code,
                clearance=clearance.manifest(), progress=progress, remote=request.remote, endpoint=endpoint,
                keys=request.keys,
            )  # fmt: skip
        return live.flight, live.summary


def _print(
    request: Request, plan: Plan, flight: Flight, summary: dict[str, Any] | None, notes: Console, several: bool
) -> None:
    if flight.interrupted:
        notes.print(f"interrupted; what was flown is in {flight.run.path}", style="yellow")
    if flight.failure:
        print(f"perch-hil: could not run: {flight.failure} (recording: {flight.run.path})", file=sys.stderr)
    if request.as_json:
        print(json.dumps(_row(plan, flight) | ({"live": summary} if summary else {})), flush=True)
        return
    if several:
        notes.print(_line(flight.score), highlight=False)
        return
    if not flight.failure:
        Console().print(
            run_table(flight.score, plan.scenario, run_dir=flight.run.path, real_time_factor=flight.real_time_factor)
        )
    troubles = {name: count for name, count in flight.counters.items() if count}
    if troubles:
        Console().print("counted: " + ", ".join(f"{count} {name}" for name, count in troubles.items()))
    if summary:
        Console().print("\n".join(live_lines(summary)), highlight=False)


def _row(plan: Plan, flight: Flight) -> dict[str, Any]:
    return json_row(
        flight.score,
        published_row(plan.scenario),
        policy=plan.policy_name,
        camera=plan.rig.camera.source,
        real_time_factor=flight.real_time_factor,
        run_dir=flight.run.path,
    )


def _line(score: Score) -> str:
    why = f" ({'; '.join(score.reasons)})" if score.reasons else ""
    return f"seed {score.seed}: {score.verdict}{why}"
