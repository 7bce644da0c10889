"""`perch-hil campaign`: flies policies over scenarios and seeds, and compares them.

Successes are counted with exact intervals and compared seed by seed.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hil.cli.legends import CAMPAIGN, explained
from hil.cli.options import (
    COULD_NOT_RUN,
    INTERRUPTED,
    POLICIES,
    USAGE,
    Camera,
    Json,
    Rig,
    fail,
    parse_seeds,
)

if TYPE_CHECKING:
    from hil.campaign.lines import Line


@explained(CAMPAIGN)
def campaign(
    scenarios: Annotated[list[str] | None, typer.Argument(help="names or .toml files [default: all published]")] = None,
    policy: Annotated[
        list[str] | None,
        typer.Option(
            help=f"{POLICIES} or PATH.onnx; repeated: the first is what the others are compared with "
            "[default: the rig's]"
        ),
    ] = None,
    seeds: Annotated[str, typer.Option(help="A..B, both included: the same for every policy")] = "0..9",
    rig: Rig = "sim",
    camera: Camera = None,
    pictures: Annotated[Literal["preview", "all", "none"], typer.Option(help="which pictures to record")] = "none",
    jobs: Annotated[int | None, typer.Option(min=1, max=256, help="flights at a time [default: one a core]")] = None,
    out: Annotated[Path, typer.Option(help="folder of this campaign's runs and page")] = Path("campaign"),
    as_json: Json = False,
) -> None:
    """Fly scenarios with several policies, and compare them.

    Every scenario, with every policy, on every seed; leaves campaign.html, and says which policy is better.

    After a stop of any kind the same command goes on, and flies only what the folder does not hold yet.

    Exit code: 0 all flown, 2 usage or configuration, 3 some could not be flown, 130 interrupted.
    """
    from hil.assembly.rig import load_rig
    from hil.campaign.grid import CampaignError, Grid, check, left_to_do
    from hil.recording.provenance import ProvenanceError, code
    from hil.recording.runs import RunError
    from kernel.toml_errors import ConfigError
    from policies.flying.contract import ContractError
    from scenarios.spec import list_scenarios

    try:
        policies = tuple(policy or [load_rig(rig).policy.kind])
        flown = tuple(scenarios or list_scenarios())
        grid = Grid(flown, policies, parse_seeds(None, seeds), rig, camera, pictures, out)
        wanted = check(grid)
    except (ConfigError, ContractError, ValueError) as error:
        raise fail(str(error), USAGE) from None
    interrupted, failures = False, 0
    try:
        todo = left_to_do(grid, wanted)
        failures = _fly(grid, todo, len(wanted), jobs or os.cpu_count() or 1, code()) if todo else 0
    except KeyboardInterrupt:
        interrupted = True
    except (CampaignError, ProvenanceError, RunError, OSError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    _conclude(out, Path(grid.policies[0]).name, as_json)
    if interrupted:
        raise fail("interrupted; the same command goes on from here", INTERRUPTED)
    if failures:
        raise fail(f"{failures} of {len(wanted)} could not be flown: see above", COULD_NOT_RUN)


def _fly(grid: Any, todo: list[Any], total: int, processes: int, code: Any) -> int:
    """Fly with progress on stderr; returns how many could not be."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from hil.campaign.grid import fly_all
    from kernel.jit import cache_is_cold

    notes, failures = Console(stderr=True), 0
    if len(todo) < total:
        notes.print(f"{total - len(todo)} of {total} flights are in {grid.out} already")
    if cache_is_cold():
        notes.print("First run on this machine: compiling kernels takes a minute or two, once.", style="yellow")
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=notes, transient=True) as bar:
        task = bar.add_task("flying", total=total, completed=total - len(todo))
        for result in fly_all(grid, todo, processes, code):
            bar.advance(task)
            job = result.job
            what = result.failure or result.verdict
            why = f" ({'; '.join(result.reasons)})" if result.reasons and not result.failure else ""
            prefix = "could not run: " if result.failure else ""
            bar.console.print(
                f"{job.scenario} {Path(job.policy).name} seed {job.seed}: {prefix}{what}{why}", highlight=False
            )
            failures += bool(result.failure)
    return failures


def _conclude(out: Path, baseline: str, as_json: bool) -> None:
    """Page, table and comparison of everything the folder holds."""
    from hil.campaign.lines import gather
    from hil.cli.screen import print_json, say, screen
    from hil.recording.runs import list_runs
    from hil.report.campaign import CONFIDENCE, render
    from hil.report.comparison_table import comparisons

    lines, _ = gather(list_runs(out))
    if not lines:
        return
    page = out / "campaign.html"
    page.write_text(render(list_runs(out), f"Campaign {out.resolve().name}", baseline), encoding="utf-8")
    compared = comparisons(lines, baseline, CONFIDENCE)
    groups = _counts(lines)
    if as_json:
        fields = ("policy", "against", "scenario", "says")
        found = {"counts": groups, "comparisons": [dict(zip(fields, row, strict=True)) for row in compared]}
        print_json({**found, "page": str(page)})
        return
    screen().print(_table(groups))
    say(CAMPAIGN)
    for policy, against, scenario, finding in compared:
        say(f"{policy} against {against}, {scenario}: {finding}")
    say(f"page: {page}")


def _counts(lines: list[Line]) -> list[dict[str, Any]]:
    from hil.scoring.binomial import interval

    found: dict[Any, list[Line]] = {}
    for line in lines:
        found.setdefault(line.group, []).append(line)
    rows = []
    for group, members in sorted(found.items()):
        row: dict[str, Any] = {**group._asdict(), "runs": len(members)}
        for key in ("within_tolerance", "attached"):
            row[key] = sum(bool(line.score[key]) for line in members)
            row[f"{key}_interval"] = interval(row[key], len(members))
        rows.append(row)
    return rows


def _table(groups: list[dict[str, Any]]) -> Any:
    from rich import box
    from rich.table import Table

    from hil.cli.console import rate_text

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in ("scenario", "policy", "camera"):
        table.add_column(column, overflow="fold")
    for column in ("within tolerance", "attached"):
        table.add_column(column, justify="right", no_wrap=True)
    for row in groups:
        within, attached = rate_text(row["within_tolerance"], row["runs"]), f"{row['attached']} of {row['runs']}"
        camera = f"{row['camera']} {row['rig']}".strip()
        table.add_row(row["scenario"], row["policy"], camera, within, attached)
    return table


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(campaign)
