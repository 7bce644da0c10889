"""`perch-hil runs list|diff|replay|recover|report|view|export`: lists, compares, replays, repairs, shows and exports
recorded runs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hil.cli.groups import add_group
from hil.cli.legends import RUNS, explained
from hil.cli.options import COULD_NOT_RUN, DIFFERENT, OK, POLICIES, Json, fail
from hil.cli.report import export, report, view


def register(app: typer.Typer) -> None:
    """Add the group; `perch-hil runs FOLDER` lists."""
    commands = {
        "list": runs, "diff": diff, "replay": replay, "recover": recover, "report": report, "view": view,
        "export": export,
    }  # fmt: skip
    text = "What flights left: list, compare, replay, repair, show, export."
    add_group(app, "runs", text, commands, lists=True)


@explained(RUNS)
def runs(
    folder: Annotated[Path, typer.Argument(help="where run folders are")] = Path("runs"),
    scenario: Annotated[str | None, typer.Option(help="only this scenario")] = None,
    rig: Annotated[str | None, typer.Option(help="only this rig (name or title)")] = None,
    policy: Annotated[str | None, typer.Option(help="only this policy: name, or beginning of its sha256")] = None,
    verdict: Annotated[
        str | None, typer.Option(help="only: perched, attached, missed, incomplete, none or damaged")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="also write all columns there as CSV")] = None,
    parquet: Annotated[Path | None, typer.Option(help="also write all columns there as Parquet")] = None,
    as_json: Json = False,
) -> None:
    """List runs, oldest first.

    Verdicts: perched is attached and within tolerance, attached is outside it, missed is not attached.

    Exit code: 0, also if there are none; 2 usage; 3 a table could not be written.
    """
    from hil.cli.screen import print_json, say, screen
    from hil.recording import runs_table

    try:
        found = runs_table.select(runs_table.rows(folder), scenario=scenario, rig=rig, policy=policy, verdict=verdict)
    except ValueError as error:
        raise fail(str(error)) from None
    try:
        if csv is not None:
            runs_table.write_csv(csv, found)
        if parquet is not None:
            runs_table.write_parquet(parquet, found)
    except runs_table.TableError as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    if as_json:
        print_json([asdict(row) for row in found])
        return
    if found:
        screen().print(runs_table.table(found))
        say(RUNS)
    print(f"{len(found)} run{'' if len(found) == 1 else 's'} in {folder}")


def diff(
    run_a: Annotated[Path, typer.Argument(help="a run folder")],
    run_b: Annotated[Path, typer.Argument(help="another")],
    as_json: Json = False,
) -> None:
    """Compare two runs message by message, byte for byte.

    Exit code: 0 identical but for the manifest's wall clock, 1 different, 2 not two readable runs.
    """
    from hil.cli.screen import print_json
    from hil.recording.diff import diff_runs
    from hil.recording.reader import ReadError
    from hil.recording.runs import RunError

    try:
        result = diff_runs(run_a, run_b)
    except (RunError, ReadError) as error:
        raise fail(str(error)) from None
    if as_json:
        print_json({"identical": result.identical, **asdict(result)})
    else:
        print("\n".join(result.lines()))
    raise typer.Exit(OK if result.identical else DIFFERENT)


def replay(
    run: Annotated[Path, typer.Argument(help="a run folder, of either host")],
    nodes: Annotated[list[str] | None, typer.Option("--node", help="which nodes [default: all that can be]")] = None,
    tolerance: Annotated[float, typer.Option(min=0, help="difference of numbers that counts as none")] = 0.0,
    ignore: Annotated[list[str] | None, typer.Option(help="topic, or topic.field, not to be compared")] = None,
    policy: Annotated[str | None, typer.Option(help=f"in place of the run's policy: {POLICIES} or PATH.onnx")] = None,
    as_json: Json = False,
) -> None:
    """Step nodes of a recorded run again, with the present code.

    Each step gets what it consumed in the run; what it publishes is compared with the recording.

    Exit code: 0 nothing differs, 1 something does, 2 the run cannot be replayed.
    """
    from hil.cli.screen import print_json
    from hil.host.replay import ReplayError, replay_run
    from hil.recording.reader import ReadError
    from hil.recording.runs import RunError

    try:
        found = replay_run(run, nodes or (), tolerance=tolerance, ignore=ignore or (), policy=policy)
    except (ReplayError, RunError, ReadError, ValueError) as error:
        raise fail(str(error)) from None
    if as_json:
        print_json({"same": found.same, **asdict(found)})
    else:
        print("\n".join(found.lines()))
    raise typer.Exit(OK if found.same else DIFFERENT)


def recover(run: Annotated[Path, typer.Argument(help="a run folder whose recording was cut off")]) -> None:
    """Repair a recording that was cut off.

    Everything readable goes into a whole run.mcap; the original is kept beside it.

    Exit code: 0 whole now (or was already), 2 no run of ours, or nothing in it can be read.
    """
    from datetime import UTC, datetime

    from hil.recording.recover import RecoverError
    from hil.recording.recover import recover as repair

    try:
        done = repair(run, datetime.now(UTC))
    except RecoverError as error:
        raise fail(str(error)) from None
    if done.original is None:
        print(f"{done.run}: the recording is whole ({done.messages} messages): nothing to do")
        return
    for fault in done.faults:
        print(f"was: {fault}")
    print(f"{done.run}: {done.messages} messages over {done.seconds:.2f} s recovered; original: {done.original.name}")
