"""`perch-hil check`: the crew's checklists before and after a flight."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.options import OK, Json, Keys, Out, Policy, Records, ScenarioRig, fail


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command("check")(check)


def check(
    what: Annotated[str | None, typer.Argument(help="preflight, postflight, or a path to a .toml of your own")] = None,
    rig: ScenarioRig = None,
    policy: Policy = None,
    scenario: Annotated[str, typer.Option(help="what is to be flown: the go is for its class only")] = "simple-i",
    own: Annotated[Path | None, typer.Option("--list", help="another list (.toml) in place of the named one")] = None,
    record: Annotated[Path | None, typer.Option(help="record to begin or to go on with [default: in checks/]")] = None,
    records: Records = Path("checks"),
    operator: Annotated[str | None, typer.Option(help="your name; asked for if there is a terminal")] = None,
    sign: Annotated[bool, typer.Option("--sign", help="sign a go without asking; needs --operator")] = False,
    crew_key: Annotated[Path | None, typer.Option("--key", help="the crew's Ed25519 key (PEM), to sign with")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="begin anew even if a record is open")] = False,
    run: Annotated[Path | None, typer.Option(help="run to look back on [default: the newest under --out]")] = None,
    out: Out = Path("runs"),
    as_json: Json = False,
    junit_file: Annotated[Path | None, typer.Option("--junit", help="also write JUnit XML there")] = None,
    endpoint: Annotated[
        str | None, typer.Option(help="address of the rig's hub, tcp/HOST:PORT, to compare the hosts' clocks")
    ] = None,
    keys: Keys = None,
    names: Annotated[bool, typer.Option("--names", help="list the automatic checks a list may use, and leave")] = False,
) -> None:
    """Walk through a checklist before or after a flight.

    Automatic items read the rig, the others ask you.

    Keys: p pass, f fail, s skip (both ask why), m enter a number, b back, q stop here. A group opens when the one
    before it passed. The record is on disk after every item: the same command goes on where it stopped, with the
    automatic items checked again and your answers kept. A rig with a real device arms only with a signed go that is
    younger than four hours, for exactly this rig, autopilot, policy, scenario (or published class), list and code.

    Exit code: 0 go and signed, 1 no-go, 2 usage, 3 aborted, 4 incomplete (not all known, or not signed).
    """
    from hil.check.command import CheckRequest, print_names, run_checklist
    from hil.check.records import ABORTED
    from hil.recording.provenance import ProvenanceError

    if names:
        print_names(as_json)
        raise typer.Exit(OK)
    if what is None and own is None:
        raise fail("which checklist? perch-hil check preflight, perch-hil check postflight, or a path to a .toml")
    if sign and not operator:
        raise fail("--sign needs --operator NAME: a signature needs a name")
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
        as_json=as_json,
        junit_file=junit_file,
        endpoint=endpoint or "",
        keys=keys,
        crew_key=crew_key,
    )
    try:
        code = run_checklist(request)
    except (ValueError, ProvenanceError) as error:
        raise fail(str(error)) from None
    except (KeyboardInterrupt, EOFError):
        raise fail("aborted before the first item", ABORTED) from None
    raise typer.Exit(code)
