"""`perch-hil refly` and `reality`: a recorded run flown again, changed; and compared with its simulated twin."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from hil.cli.options import COULD_NOT_RUN, Camera, Json, Out, Policy, ScenarioRig, fail, parse_seeds


def refly(
    run: Annotated[Path, typer.Argument(help="the folder of a run, simulated or real")],
    policy: Policy = None,
    seeds: Annotated[str, typer.Option(help="A..B, both included: what is drawn again")] = "0..9",
    source: Annotated[
        Literal["any", "mocap", "truth", "wheels"], typer.Option(help="what the board's motion is taken from")
    ] = "any",
    rig: ScenarioRig = None,
    camera: Camera = None,
    pictures: Annotated[
        Literal["preview", "all", "raw", "none"], typer.Option(help="which pictures to record")
    ] = "none",
    out: Out = Path("again"),
    as_json: Json = False,
) -> None:
    """Fly a recorded run again, with another policy or new noise.

    The board moves as it did, the vehicle starts where it was, the rest is simulated. The scenario is left in the
    folder as again.toml, to be changed or flown in a campaign.

    Exit code: as for `perch-hil run`.
    """
    from hil.campaign.refly import scenario_again, write_scenario
    from hil.cli.flights import Request, plan_of
    from hil.cli.run import fly_request
    from hil.cli.screen import say
    from hil.recording.runs import RunError, open_run
    from hil.scoring.verdict import verdict_word
    from kernel.toml_errors import ConfigError
    from policies.flying.contract import ContractError

    try:
        wanted = parse_seeds(None, seeds)
        first = open_run(run)
        scenario = scenario_again(first, source)
        out.mkdir(parents=True, exist_ok=True)
        write_scenario(out / "again.toml", scenario)
        named = first.manifest["policy"]
        flown = policy or named.get("path") or named["name"]
        request = Request(
            scenario=str(out / "again.toml"), rig=rig, policy=flown, camera=camera, pictures=pictures, out=out,
            records=Path("checks"),
        )  # fmt: skip
        plan = plan_of(request, wanted)
        if not plan.rig.simulated:
            raise ConfigError(f'rig "{plan.rig_name}" has real devices: a recorded flight is flown again in simulation')
        score = first.score
    except (ConfigError, ContractError, RunError, ValueError) as error:
        raise fail(str(error)) from None
    except OSError as error:
        raise fail(f"{out}: cannot be written: {error.strerror}") from None
    if score is not None and not as_json:
        word = verdict_word(
            attached=score["attached"], within_tolerance=score["within_tolerance"], outcome=score["outcome"],
            state=str(first.manifest.get("state", "finished")),
        )  # fmt: skip
        why = f" ({'; '.join(score['reasons'])})" if score["reasons"] else ""
        say(f"the flight itself, {named['name']}: {word}{why}")
    raise typer.Exit(fly_request(request, plan, wanted, as_json))


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
    """Add both commands to the command line."""
    app.command()(refly)
    app.command()(reality)
