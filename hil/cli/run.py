"""`perch-hil run`: flies a scenario, once or with many seeds, and prints the results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hil.cli.legends import FLIGHTS, explained
from hil.cli.options import (
    COULD_NOT_RUN,
    INTERRUPTED,
    NOT_PERCHED,
    PERCHED,
    Camera,
    Json,
    Keys,
    Out,
    Policy,
    Records,
    ScenarioRig,
    complain,
    fail,
    parse_seeds,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from hil.assembly.plan import Plan
    from hil.cli.flights import Flown, Request
    from hil.scoring.score import Score


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("run")(run)


@explained(FLIGHTS)
def run(
    scenario: Annotated[str, typer.Argument(help="a scenario's name (see `perch-hil scenarios`) or a path to a .toml")],
    seed: Annotated[int | None, typer.Option(help="varies spline, start, noise and airframe [default: 0]")] = None,
    seeds: Annotated[str | None, typer.Option(help="several: A..B, both included")] = None,
    rig: ScenarioRig = None,
    policy: Policy = None,
    camera: Camera = None,
    pictures: Annotated[
        Literal["preview", "all", "raw", "none"],
        typer.Option(
            help="which pictures to record (preview: half size, 15 Hz; raw: as a replay of the detector needs them)"
        ),
    ] = "preview",
    out: Out = Path("runs"),
    as_json: Json = False,
    live: Annotated[bool, typer.Option("--live", help="in real time, one process a service, over Zenoh")] = False,
    remote: Annotated[
        list[str] | None, typer.Option(help="live: a service that another host serves (`perch-hil bus node`)")
    ] = None,
    endpoint: Annotated[
        str | None, typer.Option(help="live: address of the hub, tcp/HOST:PORT [default: a free local port]")
    ] = None,
    keys: Keys = None,
    records: Records = Path("checks"),
    view: Annotated[bool, typer.Option("--view", help="watch it in Rerun while it flies")] = False,
    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="live: serve it to Foxglove, on this computer's loopback")
    ] = False,
    foxglove_port: Annotated[int, typer.Option(min=0, max=65535, help="of --foxglove; 0: a free one")] = 8765,
    override: Annotated[
        str | None, typer.Option("--override-check", help="reason to arm a real vehicle without a signed go")
    ] = None,
) -> None:
    """Fly a scenario and score it against the perching tolerances.

    Each run leaves one folder: manifest.json, run.mcap, score.json. With --json: one object a run, a line each.

    Exit code: 0 every run perched (attached and within tolerance), 1 not, 2 usage or configuration, 3 could not run,
    130 interrupted.
    """
    from hil.cli.flights import Request, plan_of
    from kernel.toml_errors import ConfigError
    from policies.flying.contract import ContractError

    try:
        request = Request(
            scenario=scenario, rig=rig, policy=policy, camera=camera, pictures=pictures, out=out,
            records=records, override=override, live=live, remote=tuple(remote or ()), endpoint=endpoint, keys=keys,
            view=view, foxglove=foxglove_port if foxglove else None,
        )  # fmt: skip
        wanted = parse_seeds(seed, seeds)
        plan = plan_of(request, wanted)
    except (ConfigError, ContractError, ValueError) as error:
        raise fail(str(error)) from None
    raise typer.Exit(fly_request(request, plan, wanted, as_json))


def fly_request(request: Request, plan: Plan, seeds: Sequence[int], as_json: bool) -> int:
    """Fly and print; returns the exit code."""
    from rich.console import Console

    from hil.check.interlock import NotClearedError
    from hil.cli.console import seeds_table
    from hil.cli.screen import screen
    from hil.live.supervisor import SupervisorError
    from hil.recording.provenance import ProvenanceError
    from hil.recording.recorder import RecordingError
    from hil.recording.runs import RunError
    from hil.viewer.view import ViewerError
    from hil.wires import WireError

    notes = Console(stderr=True)
    try:
        compile_first(notes, [(request.scenario, request.rig, request.policy, request.camera)])
        flown = _fly_with_progress(request, plan, seeds, as_json, notes)
    except ViewerError as error:
        raise fail(str(error), error.code) from None
    except (RunError, RecordingError, NotClearedError, SupervisorError, ProvenanceError, WireError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    if len(seeds) > 1 and not as_json:
        screen().print(seeds_table(plan.scenario, [one.flight.score for one in flown]))
    return _exit_code(flown) if len(flown) == len(seeds) else INTERRUPTED


def compile_first(notes: Console, runs: Sequence[tuple[str, str | None, str | None, str | None]]) -> None:
    """On the first run compile the kernels of `runs` (scenario, rig, policy, camera) on all cores, and say so."""
    from hil.host.first_run import Wanted, compile_kernels, is_first_run

    if not is_first_run():
        return
    notes.print("First run of this version here: compiling kernels takes a minute or two, once.", style="yellow")
    try:
        with notes.status("compiling"):
            compile_kernels([Wanted(*run) for run in runs])
    except KeyboardInterrupt:
        raise fail("interrupted; what has been compiled is kept", INTERRUPTED) from None


def _fly_with_progress(
    request: Request, plan: Plan, seeds: Sequence[int], as_json: bool, notes: Console
) -> list[Flown]:
    """Fly with a line of progress on stderr; each flight is printed when it has ended."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from hil.cli.flights import Listener, fly_seeds

    found: list[Flown] = []
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=notes, transient=True) as bar:
        name = plan.scenario.name
        task = bar.add_task(f"{name}: starting")

        def progress(seed: int, now_ns: int, stage: str) -> None:
            bar.update(task, description=f"{name} seed {seed}: {stage}, {now_ns * 1e-9:.1f} s")

        listener = Listener(progress, lambda text: notes.print(text, soft_wrap=True, highlight=False))
        for flown in fly_seeds(request, plan, seeds, listener):
            found.append(flown)
            bar.stop()
            _print(plan, flown, notes, as_json, several=len(seeds) > 1)
            if not _fetch_log(request, plan, flown, bar, task, notes):
                break
            bar.reset(task, description=f"{name}: starting")
            bar.start()
    return found


def _fetch_log(request: Request, plan: Plan, flown: Flown, bar: Progress, task: TaskID, notes: Console) -> bool:
    """After a live flight the log of a real autopilot comes into the run's folder. False: the user wants to end."""
    from hil.bench.flight_log import fetch_log, log_link

    link = log_link(plan.rig.vehicle, request.remote) if request.live and not flown.flight.interrupted else ""
    if not link:
        return True
    run, remark = flown.flight.run, "fetching the autopilot's log was ended by Ctrl-C"
    bar.update(task, description="the autopilot's log")
    bar.start()
    try:
        remark = fetch_log(
            link, plan.rig.vehicle, run.path, run.recording,
            lambda share: bar.update(task, description=f"the autopilot's log: {100 * share:.0f} %"),
        )  # fmt: skip
    except KeyboardInterrupt:
        return False
    finally:
        bar.stop()
        if remark:
            notes.print(remark, soft_wrap=True, highlight=False)
    return True


def _print(plan: Plan, flown: Flown, notes: Console, as_json: bool, several: bool) -> None:
    from hil.cli.console import json_row, run_table
    from hil.cli.screen import print_json, say, screen
    from hil.live.timing import timing_lines
    from hil.recording.manifest import board_known_by
    from scenarios.spec import published_row

    flight = flown.flight
    if flown.unseen:
        notes.print(f"the viewer was too slow for {flown.unseen} messages; the recording has them all")
    if flight.interrupted:
        notes.print(f"interrupted; what was flown is in {flight.run.path}", style="yellow")
    if flight.failure:
        complain(f"could not run: {flight.failure} (recording: {flight.run.path})")
    folder, factor = flight.run.path, flight.real_time_factor
    if as_json:
        row: dict[str, Any] = json_row(
            flight.score, published_row(plan.scenario), policy=plan.policy_name,
            camera=board_known_by(plan.rig.model_dump()), real_time_factor=factor, run_dir=folder,
        )  # fmt: skip
        print_json(row | ({"live": flown.timing} if flown.timing else {}))
        return
    if several:
        notes.print(_line(flight.score), highlight=False)
        return
    if not flight.failure:
        screen().print(run_table(flight.score, plan.scenario, real_time_factor=factor))
        say(f"run folder: {folder}")
    troubles = {name: count for name, count in flight.counters.items() if count}
    if troubles:
        say("counted: " + ", ".join(f"{count} {name}" for name, count in troubles.items()))
    if flown.timing:
        say("\n".join(timing_lines(flown.timing)))


def _line(score: Score) -> str:
    why = f" ({'; '.join(score.reasons)})" if score.reasons else ""
    return f"seed {score.seed}: {score.verdict}{why}"


def _exit_code(flown: Sequence[Flown]) -> int:
    if any(one.flight.interrupted for one in flown):
        return INTERRUPTED
    if any(one.flight.failure for one in flown):
        return COULD_NOT_RUN
    return PERCHED if all(one.flight.score.verdict == "perched" for one in flown) else NOT_PERCHED
