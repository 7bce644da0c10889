"""`perch-hil`: the command line. Exit codes: 0 perched, 1 not, 2 usage or configuration, 3 could not
run, 130 interrupted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from hil.cli import campaign as cli_campaign
from hil.cli import check as cli_check
from hil.cli import live as cli_live
from hil.cli import report as cli_report
from hil.cli import train as cli_train
from hil.cli.options import fail, parse_seeds

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Test harness and field-ops toolkit for perching a quadrotor on a moving, inclined board.\n\n"
    "Start with `perch-hil run hard-i`; `perch-hil scenarios` lists what can be flown.",
)


@app.command()
def run(
    scenario: Annotated[str, typer.Argument(help="a scenario's name (see `perch-hil scenarios`) or a path to a .toml")],
    seed: Annotated[int | None, typer.Option(help="varies spline, start, noise and airframe [default: 0]")] = None,
    seeds: Annotated[str | None, typer.Option(help="several: A..B, both included")] = None,
    rig: Annotated[str, typer.Option(help="a rig's name or a path to a .toml")] = "sim",
    policy: Annotated[
        str | None, typer.Option(help="vision, planner, planner-analytic or an .onnx [default: the rig's]")
    ] = None,
    camera: Annotated[
        Literal["pictures", "model"] | None,
        typer.Option(help="pictures: rendered and detected; model: the paper's visibility gate and noise"),
    ] = None,
    pictures: Annotated[
        Literal["preview", "all", "raw", "none"],
        typer.Option(
            help="which pictures to record (preview: half size, 15 Hz; raw: as `replay` of the detector needs them)"
        ),
    ] = "preview",
    out: Annotated[Path, typer.Option(help="where run folders go")] = Path("runs"),
    as_json: Annotated[bool, typer.Option("--json", help="one object a run on stdout, nothing else there")] = False,
    live: Annotated[bool, typer.Option("--live", help="in real time, a process a service, over Zenoh")] = False,
    remote: Annotated[
        list[str] | None, typer.Option(help="live: a service that another host serves (`perch-hil node`)")
    ] = None,
    endpoint: Annotated[str | None, typer.Option(help="live: the hub's endpoint [default: a free local port]")] = None,
    keys: Annotated[Path | None, typer.Option(help="live: folder of `perch-hil keys`, which closes the bus")] = None,
    checks: Annotated[Path, typer.Option(help="where signed checklist records lie")] = Path("checks"),
    view: Annotated[bool, typer.Option("--view", help="watch it in Rerun while it flies")] = False,
    override: Annotated[
        str | None, typer.Option("--override-check", help="reason to arm a real vehicle without a signed go")
    ] = None,
) -> None:
    """Fly a scenario and score it against the perching tolerances.

    Exit code: 0 every run perched (attached and within tolerance), 1 not, 2 usage or configuration, 3 could not run,
    130 interrupted. Each run leaves one folder: manifest.json, run.mcap, score.json.
    """
    from hil.cli.flights import Request, fly_seeds

    try:
        wanted = parse_seeds(seed, seeds)
    except ValueError as error:
        raise fail(str(error)) from None
    request = Request(
        scenario=scenario,
        rig=rig,
        policy=policy,
        camera=camera,
        pictures=pictures,
        out=out,
        checks=checks,
        override=override,
        as_json=as_json,
        live=live,
        remote=tuple(remote or ()),
        endpoint=endpoint,
        keys=keys,
        view=view,
    )
    code = fly_seeds(request, wanted)
    raise typer.Exit(code)


@app.command()
def scenarios(as_json: Annotated[bool, typer.Option("--json", help="machine-readable")] = False) -> None:
    """List the scenarios that come with the project."""
    from rich.console import Console

    from hil.cli.console import scenarios_table
    from scenarios.spec import list_scenarios, load

    specs = [load(name) for name in list_scenarios()]
    if as_json:
        print(json.dumps([spec.model_dump(mode="json") for spec in specs]))
    else:
        Console().print(scenarios_table(specs))


@app.command()
def diff(
    run_a: Annotated[Path, typer.Argument(help="a run folder")],
    run_b: Annotated[Path, typer.Argument(help="another")],
) -> None:
    """Compare two runs message by message, byte for byte.

    Exit code: 0 identical but for the manifest's wall clock, 1 different, 2 not two readable runs.
    """
    from hil.recording.diff import diff_runs
    from hil.recording.reader import ReadError
    from hil.recording.runs import RunError

    try:
        result = diff_runs(run_a, run_b)
    except (RunError, ReadError) as error:
        raise fail(str(error)) from None
    print("\n".join(result.lines()))
    raise typer.Exit(0 if result.identical else 1)


@app.command("board")
def board_file(path: Annotated[Path, typer.Argument(help="file to write: .pdf, .svg or .png")]) -> None:
    """Write the board's tags as a printable file, at true size."""
    from groundcar.board.layout import Board
    from groundcar.board.printing import write_printable

    board = Board()
    try:
        write_printable(path, board)
    except (OSError, ValueError) as error:
        raise fail(str(error)) from None
    print(f"wrote {path}: print at 100 %, check the large tag measures {1e3 * board.tags[0].width:.1f} mm")


cli_check.register(app)
cli_report.register(app)
cli_campaign.register(app)
cli_live.register(app)
cli_train.register(app)


def main() -> None:
    """Entry point of the `perch-hil` command."""
    app()
