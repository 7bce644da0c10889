"""`perch-hil campaign`: flies policies over scenarios and seeds, compares them, and judges requirements on them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hil.cli.campaign_plan import draw, plan
from hil.cli.groups import DefaultGroup
from hil.cli.legends import CAMPAIGN, explained
from hil.cli.options import (
    COULD_NOT_RUN,
    DIFFERENT,
    INTERRUPTED,
    POLICIES,
    UNDECIDED,
    USAGE,
    Camera,
    Cluster,
    Json,
    ScenarioRig,
    complain,
    fail,
    parse_seeds,
)

if TYPE_CHECKING:
    from hil.campaign.flying import Flying
    from hil.campaign.grid import Job
    from hil.campaign.require import Requirement


class _FliesByDefault(DefaultGroup):
    default = "fly"


@explained(CAMPAIGN)
def fly(
    scenarios: Annotated[list[str] | None, typer.Argument(help="names or .toml files [default: all published]")] = None,
    policy: Annotated[
        list[str] | None,
        typer.Option(
            help=f"{POLICIES} or PATH.onnx; repeated: the first is what the others are compared with "
            "[default: the rig's]"
        ),
    ] = None,
    seeds: Annotated[str, typer.Option(help="A..B, both included: the same for every policy")] = "0..9",
    rig: ScenarioRig = None,
    camera: Camera = None,
    pictures: Annotated[Literal["preview", "all", "none"], typer.Option(help="which pictures to record")] = "none",
    faults: Annotated[
        Path | None,
        typer.Option(help="a .toml file of [[fault]] tables (see `perch-hil faults`), each flown alone"),
    ] = None,
    keep: Annotated[
        Literal["all", "unsafe"], typer.Option(help="which recordings: all, or those of flights that ended unsafe")
    ] = "all",
    require: Annotated[
        list[str] | None,
        typer.Option(
            help="'within_tolerance >= 0.9' (also attached, perched, safe), 'better', 'not worse by 0.02'; repeated"
        ),
    ] = None,
    confidence: Annotated[float, typer.Option(help="of intervals and requirements, between 0 and 1")] = 0.95,
    junit: Annotated[Path | None, typer.Option(help="file for what became of the requirements, as JUnit XML")] = None,
    sealed: Annotated[
        Path | None, typer.Option(help="list of `campaign draw`: the folder's real flights are compared with it")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, max=256, help="flights at a time [default: one a core]")] = None,
    cluster: Cluster = None,
    out: Annotated[Path, typer.Option(help="folder of this campaign's runs and page")] = Path("campaign"),
    as_json: Json = False,
) -> None:
    """Fly scenarios with several policies, and compare them.

    Every scenario, with every policy, on every seed; leaves campaign.html, and says which policy is better. With
    --faults each fault is flown by itself on all of them, and every flight ends in one class.

    After a stop of any kind the same command goes on, and flies only what the folder does not hold yet.

    Exit code: 0 all flown, requirements met, 1 a requirement is not met or a flight with a fault was unsafe, 2 usage or
    configuration, 3 some could not be flown, 4 undecided at this number of flights, 130 interrupted.
    """
    from rich.console import Console

    from hil.assembly.rig import chosen_rig, load_rig
    from hil.campaign.draw import read_list
    from hil.campaign.flying import Flying
    from hil.campaign.grid import Grid, check, left_to_do
    from hil.campaign.require import MET, NOT_MET, read
    from hil.campaign.workers.work import ClusterError, WorkersError
    from hil.cli.run import compile_first
    from hil.recording.provenance import ProvenanceError, code
    from hil.recording.runs import RunError
    from hil.report.conclusion import Conclusion, conclude
    from kernel.toml_errors import ConfigError, load_toml
    from policies.flying.contract import ContractError
    from scenarios.faults import FaultFile
    from scenarios.spec import list_scenarios, load

    try:
        if not 0.5 <= confidence < 1.0:
            raise ConfigError(f"--confidence {confidence:g}: give 0.5 or more, and less than 1")
        if junit is not None and not require:
            raise ConfigError("--junit says what became of requirements: give --require")
        requirements = [read(text) for text in require or ()]
        flown = tuple(scenarios or (name for name in list_scenarios() if load(name).published))
        rigs = {name: load_rig(name) for name in dict.fromkeys(chosen_rig(load(scenario), rig) for scenario in flown)}
        policies = tuple(policy or dict.fromkeys(one.policy.kind for one in rigs.values()))
        if not policy and len(policies) > 1:
            raise ConfigError(f"the scenarios' rigs {', '.join(rigs)} fly different policies: give --policy or --rig")
        _check_pairs(requirements, policies)
        listed = read_list(sealed) if sealed else None
        tables = load_toml(faults, FaultFile).fault if faults else ()
        grid = Grid(flown, policies, parse_seeds(None, seeds), rig, camera, pictures, out, tables, keep)
        wanted = check(grid)
        firmware = [name for name, one in rigs.items() if one.vehicle.kind == "hitl"]
        if cluster and firmware:
            raise ConfigError(f'rig "{firmware[0]}" flies a firmware of this machine: leave out --cluster')
    except (ConfigError, ContractError, ValueError) as error:
        raise fail(str(error), USAGE) from None
    interrupted, failures = False, 0
    found: Conclusion | None = None
    try:
        todo = left_to_do(grid, wanted)
        if todo and cluster is None:
            first = {job.policy: job.scenario for job in todo}
            compile_first(Console(stderr=True), [(first[one], rig, one, camera) for one in first])
        failures = _fly(Flying.of(grid, todo, code()), todo, len(wanted), cluster, jobs) if todo else 0
    except KeyboardInterrupt:
        interrupted = True
    except ClusterError as error:
        raise fail(str(error), USAGE) from None
    except (WorkersError, ProvenanceError, RunError, OSError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    try:
        found = conclude(out, Path(grid.policies[0]).name, requirements, confidence, xml=junit, listed=listed)
    except (ValueError, OSError) as error:
        complain(str(error))
    _say(found, as_json)
    if interrupted:
        raise fail("interrupted; the same command goes on from here", INTERRUPTED)
    if failures:
        raise fail(f"{failures} of {len(wanted)} could not be flown: see above", COULD_NOT_RUN)
    if found is None:
        raise typer.Exit(COULD_NOT_RUN if requirements else 0)
    if found.outcome == NOT_MET or found.unsafe:
        raise typer.Exit(DIFFERENT)
    if requirements and found.outcome != MET:
        raise typer.Exit(UNDECIDED)


def _check_pairs(requirements: list[Requirement], policies: tuple[str, ...]) -> None:
    from kernel.toml_errors import ConfigError

    for one in requirements:
        if one.of_pairs and len(policies) < 2:
            raise ConfigError(f'--require "{one.text}" compares policies, and there is one: give --policy twice')


def _fly(flying: Flying, todo: list[Job], total: int, cluster: str | None, jobs: int | None) -> int:
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

    from hil.campaign.workers.opening import open_workers

    notes, failures = Console(stderr=True), 0
    if len(todo) < total:
        notes.print(f"{total - len(todo)} of {total} flights are in {flying.out} already")
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    progress = Progress(*columns, TimeRemainingColumn(), console=notes, transient=True)
    with open_workers(cluster, jobs) as workers, progress as bar:
        task = bar.add_task("flying", total=total, completed=total - len(todo))
        for result in workers.each(flying, todo):
            bar.advance(task)
            job = result.job
            what = result.failure or (result.flight_class if job.fault else result.verdict)
            why = f" ({'; '.join(result.reasons)})" if result.reasons and not result.failure else ""
            prefix = "could not run: " if result.failure else ""
            name = " ".join(filter(None, (job.scenario, job.fault, Path(job.policy).name)))
            bar.console.print(f"{name} seed {job.seed}: {prefix}{what}{why}", highlight=False)
            failures += bool(result.failure)
    return failures


def _say(found: Any, as_json: bool) -> None:
    """Print tables, comparisons and decisions."""
    from hil.cli.screen import print_json, say, screen

    if found is None:
        return
    if as_json:
        print_json(found.as_dict())
        return
    if found.counts:
        screen().print(_table(found.counts, found.confidence))
        say(CAMPAIGN)
    if found.classes:
        screen().print(_fault_table(found.classes))
    for policy, against, scenario, finding in found.comparisons:
        say(f"{policy} against {against}, {scenario}: {finding}")
    for one in found.decisions:
        said = f"{one.estimate:.3f} ({one.low:.3f} to {one.high:.3f}), {one.runs} flights"
        say(f"{one.outcome}: {one.requirement}, {one.policy} on {one.scenario}: {said}")
    say(f"page: {found.page}")


def _table(groups: list[dict[str, Any]], confidence: float) -> Any:
    from rich import box
    from rich.table import Table

    from hil.cli.console import rate_text

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in ("scenario", "policy", "camera"):
        table.add_column(column, overflow="fold")
    for column in ("within tolerance", "attached"):
        table.add_column(column, justify="right", no_wrap=True)
    for row in groups:
        within = rate_text(row["within_tolerance"], row["runs"], confidence)
        camera = f"{row['camera']} {row['rig']}".strip()
        table.add_row(row["scenario"], row["policy"], camera, within, f"{row['attached']} of {row['runs']}")
    return table


def _fault_table(rows: list[dict[str, Any]]) -> Any:
    """Faults by class, over all scenarios and policies."""
    from rich import box
    from rich.table import Table

    columns = [name for name in rows[0] if name not in ("fault", "scenario", "policy")]
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("fault", overflow="fold")
    for name in columns:
        table.add_column(name.split(" and ")[0], justify="right")
    for fault in dict.fromkeys(row["fault"] for row in rows):
        sums = [sum(row[name] for row in rows if row["fault"] == fault) for name in columns]
        table.add_row(fault, *(str(count) if count else "-" for count in sums))
    return table


def register(app: typer.Typer) -> None:
    """Add the group to the command line."""
    group = typer.Typer(cls=_FliesByDefault, help="Fly scenarios with several policies, with faults, and decide.")
    for name, command in (("fly", fly), ("plan", plan), ("draw", draw)):
        group.command(name)(command)
    app.add_typer(group, name="campaign")
