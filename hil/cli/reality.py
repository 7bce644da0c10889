"""`perch-hil reality`: what differs between recorded runs and their simulated twins."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from hil.cli.options import COULD_NOT_RUN, Json, Out, fail


def reality(
    runs: Annotated[list[Path], typer.Argument(help="folders of recorded runs: real ones, live ones, PX4 SITL")],
    seed: Annotated[int, typer.Option(min=0, help="of the twins' noise")] = 0,
    source: Annotated[
        Literal["any", "mocap", "truth", "wheels"], typer.Option(help="what the board's motion is taken from")
    ] = "any",
    out: Out = Path("twins"),
    as_json: Json = False,
) -> None:
    """Say what differs between recorded runs and their twins.

    A twin is flown in simulation on the same board motion and commands. Leaves reality.html in the folder.

    Exit code: 0, 2 usage or a run that cannot be flown again, 3 a twin could not be flown.
    """
    from hil.campaign.reality import as_rows, compare, fly_twin, measured
    from hil.cli.screen import print_json, say, screen
    from hil.recording.provenance import ProvenanceError, code
    from hil.recording.recorder import RecordingError
    from hil.recording.runs import RunError, open_run
    from hil.report.reality import write_page
    from kernel.toml_errors import ConfigError

    try:
        recorded = [open_run(run) for run in runs]
        real = [measured(run) for run in recorded]
        built = code()
        twins = [measured(fly_twin(run, out, built, seed, source)) for run in recorded]
        found = compare(real, twins)
        page = write_page(out / "reality.html", [run.path.name for run in recorded], found)
    except (ConfigError, RunError, ValueError) as error:
        raise fail(str(error)) from None
    except (RecordingError, ProvenanceError, OSError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    if as_json:
        print_json({"runs": [str(run.path) for run in recorded], "quantities": as_rows(found), "page": str(page)})
        return
    screen().print(_table(found))
    say(f"page: {page}")


def _table(found: list[Any]) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("quantity", overflow="fold")
    for column in ("unit", "recorded", "twin", "distance", "interval"):
        table.add_column(column, justify="right", no_wrap=True)
    for one in found:
        interval = "-" if one.low is None else f"{one.low:+.3g} to {one.high:+.3g}"
        numbers = ("-" if value is None else f"{value:.3g}" for value in (one.real, one.twin, one.distance))
        table.add_row(one.name, one.unit, *numbers, interval, style="yellow" if one.differs else "")
    return table


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(reality)
