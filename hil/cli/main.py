"""`perch-hil`: the command line. Exit codes: 0 perched, 1 not, 2 usage or configuration, 3 could not run (also an
unexpected error), 130 interrupted."""

from __future__ import annotations

import sys
from importlib import metadata
from pathlib import Path
from typing import Annotated, Literal

import typer

from hil.cli import autopilot, bus, campaign, check, faults, policy, refly, results, rig, run, runs, soak
from hil.cli.options import COULD_NOT_RUN, POLICIES, Json, fail

DISTRIBUTION = "perch-hil"

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Test harness and field-ops toolkit for perching a quadrotor on a moving, inclined board.\n\n"
    "Start with `perch-hil run hard-i`; `perch-hil scenarios` lists what can be flown.\n\n"
    f"Policies that fly by name: {POLICIES}; any other by its PATH.onnx.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"{DISTRIBUTION} {metadata.version(DISTRIBUTION)}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version and leave")
    ] = False,
) -> None:
    """What every call takes."""


def scenarios(as_json: Json = False) -> None:
    """List the scenarios that come with the project."""
    from hil.cli.console import scenarios_table
    from hil.cli.screen import print_json, screen
    from scenarios.spec import list_scenarios, load

    specs = [load(name) for name in list_scenarios()]
    if as_json:
        print_json([spec.model_dump(mode="json") for spec in specs])
    else:
        screen().print(scenarios_table(specs))


def board_file(
    path: Annotated[Path, typer.Argument(help="file to write: .pdf, .svg or .png")],
    charuco: Annotated[bool, typer.Option("--charuco", help="the board that cameras are calibrated with")] = False,
    paper: Annotated[
        Literal["A4", "A3"] | None, typer.Option(help="as tiles, one a page of a .pdf [default: one page of its size]")
    ] = None,
) -> None:
    """Write the board's tags as a printable file, at true size."""
    from groundcar.board.charuco import SQUARE, charuco_sheet
    from groundcar.board.layout import Board
    from groundcar.board.printing import write_printable, write_sheet
    from groundcar.board.tiles import write_tiles

    if charuco and paper is not None:
        raise fail("--charuco fits on A4 as it is: leave --paper out")
    board = Board()
    try:
        if charuco:
            write_sheet(path, charuco_sheet())
            print(f"wrote {path}: print on A4, any scale will do; a square is {1e3 * SQUARE:.0f} mm at 100 %")
            return
        if paper is None:
            write_printable(path, board)
        else:
            pages = write_tiles(path, paper, board)
            print(f"{pages} pages of {paper}: cut each at its marks, lay them edge to edge on something flat")
    except (OSError, ValueError) as error:
        raise fail(str(error)) from None
    print(f"wrote {path}: print at 100 %, check the large tag measures {1e3 * board.tags[0].width:.1f} mm")


run.register(app)
campaign.register(app)
faults.register(app)
refly.register(app)
check.register(app)
app.command("scenarios")(scenarios)
app.command("board")(board_file)
soak.register(app)
autopilot.register(app)
results.register(app)
for group in (runs, policy, rig, bus):
    group.register(app)


def main() -> None:
    """Entry point of the `perch-hil` command. Exit code 1 is a verdict: no crash and no closed pipe may end with it."""
    try:
        app()
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # of which the library makes a 1
            raise SystemExit(COULD_NOT_RUN) from None
        raise
    except Exception as error:
        sys.excepthook(type(error), error, error.__traceback__)
        raise SystemExit(COULD_NOT_RUN) from None
