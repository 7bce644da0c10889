"""`perch-hil soak`: one long live run that checks memory and lateness."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hil.cli.options import COULD_NOT_RUN, DIFFERENT, OK, Json, Out, fail


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("soak")(soak)


def soak(
    minutes: Annotated[float, typer.Option(min=1.5, max=24 * 60, help="how long the vehicle hovers")] = 10.0,
    scenario: Annotated[str, typer.Option(help="what is then flown")] = "hard-i",
    out: Out = Path("runs"),
    as_json: Json = False,
) -> None:
    """One long live run: is memory flat, and lateness steady?

    Everything is simulated; the vehicle hovers, then the scenario is flown.

    Exit code: 0 both hold, 1 not, 2 usage, 3 could not run.
    """
    from hil.cli.screen import print_json, screen
    from hil.live.soak import soak as run_soak
    from hil.live.soak import table
    from hil.live.supervisor import SupervisorError
    from hil.recording.recorder import RecordingError
    from hil.recording.runs import RunError

    try:
        verdicts, trouble, folder = run_soak(scenario, minutes, out)
    except ValueError as error:
        raise fail(str(error)) from None
    except (RunError, RecordingError, SupervisorError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    bad = [one.service for one in verdicts if one.faults]
    if as_json:
        found = {"minutes": minutes, "flat": not bad, "services": [asdict(one) for one in verdicts]}
        print_json({**found, "run_dir": str(folder)})
    else:
        screen().print(table(verdicts))
        print(f"run folder: {folder}")
        verdict = f"NOT flat: {', '.join(bad)}" if bad else "memory flat, no growing lateness"
        print(f"soak of {minutes:g} min: {verdict}")
    if trouble:
        raise fail(f"the soak did not end by itself: {trouble}", COULD_NOT_RUN)
    raise typer.Exit(DIFFERENT if bad else OK)
