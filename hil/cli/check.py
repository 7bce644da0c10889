"""`perch-hil check`, `perch-hil runs`, `perch-hil recover`: what a crew uses around a flight."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.options import COULD_NOT_RUN, fail


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command("check")(check)
    app.command("runs")(runs)
    app.command("recover")(recover)


def check(
    what: Annotated[str | None, typer.Argument(help="preflight, postflight, or a path to a .toml of your own")] = None,
    rig: Annotated[str, typer.Option(help="a rig's name or a path to a .toml")] = "sim",
    policy: Annotated[str | None, typer.Option(help="vision, planner, planner-analytic or an .onnx")] = None,
    scenario: Annotated[str, typer.Option(help="what is to be flown: the go is for its class only")] = "simple-i",
    own: Annotated[Path | None, typer.Option("--list", help="another list (.toml) in place of the named one")] = None,
    record: Annotated[Path | None, typer.Option(help="record to begin or to go on with [default: in checks/]")] = None,
    records: Annotated[Path, typer.Option(help="where records go and where arming looks for them")] = Path("checks"),
    operator: Annotated[str | None, typer.Option(help="your name; asked for if there is a terminal")] = None,
    sign: Annotated[bool, typer.Option("--sign", help="sign a go without asking; needs --operator")] = False,
    crew_key: Annotated[Path | None, typer.Option("--key", help="the crew's Ed25519 key (PEM), to sign with")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="begin anew even if a record is open")] = False,
    run: Annotated[Path | None, typer.Option(help="run to look back on [default: the newest under --out]")] = None,
    out: Annotated[Path, typer.Option(help="where run folders go")] = Path("runs"),
    json_file: Annotated[Path | None, typer.Option("--json", help="also write the record there")] = None,
    junit_file: Annotated[Path | None, typer.Option("--junit", help="also write JUnit XML there")] = None,
    endpoint: Annotated[str, typer.Option(help="hub of the rig's other host, to compare clocks with")] = "",
    keys: Annotated[Path | None, typer.Option(help="folder of `perch-hil keys`, if that hub is closed")] = None,
    names: Annotated[bool, typer.Option("--names", help="list the automatic checks a list may use, and leave")] = False,
) -> None:
    """Walk through a checklist: automatic items read the rig, the others ask you.

    Keys: p pass, f fail, s skip (both ask why), m enter a number, b back, q stop here. A group opens when the one
    before it passed. The record is on disk after every item: the same command goes on where it stopped, with the
    automatic items checked again and your answers kept. A rig with a real device arms only with a signed go that is
    younger than four hours, for this rig, policy and class of scenario.

    Exit code: 0 go and signed, 1 no-go, 2 usage, 3 aborted, 4 incomplete (not all known, or not signed).
    """
    from hil.check.command import CheckRequest, print_names, run_checklist

    if names:
        print_names()
        raise typer.Exit(0)
    if what is None and own is None:
        raise fail("which checklist? perch-hil check preflight, perch-hil check postflight, or a path to a .toml")
    if sign and not operator:
        raise fail("--sign needs --operator NAME: a signature is somebody's")
    request = CheckRequest(
        list_name=str(own) if own is not None else str(what),
        rig=rig,
        policy=policy,
        scenario=scenario,
        record=record,
        folder=records,
        operator=operator,
        sign=sign,
        fresh=fresh,
        run=run,
        out=out,
        json_file=json_file,
        junit_file=junit_file,
        endpoint=endpoint,
        keys=keys,
        crew_key=crew_key,
    )
    raise typer.Exit(run_checklist(request))


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
) -> None:
    """List runs, oldest first: perched is attached and within tolerance, missed is not attached.

    Exit code: 0, also if there are none; 2 usage; 3 a table could not be written.
    """
    from rich.console import Console

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
    if found:
        Console().print(runs_table.table(found))
    print(f"{len(found)} run{'' if len(found) == 1 else 's'} in {folder}")


def recover(run: Annotated[Path, typer.Argument(help="a run folder whose recording was cut off")]) -> None:
    """Repair a truncated recording: everything readable goes into a whole run.mcap; the original is kept beside it.

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
