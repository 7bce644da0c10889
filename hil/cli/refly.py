"""`perch-hil refly`: the flight that failed, with another policy, its pictures rendered anew, its noise drawn again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from hil.cli.options import Camera, Json, Out, Policy, fail, parse_seeds


def refly(
    run: Annotated[Path, typer.Argument(help="the folder of a run, simulated or real")],
    policy: Policy = None,
    seeds: Annotated[str, typer.Option(help="A..B, both included: what is drawn again")] = "0..9",
    source: Annotated[
        Literal["any", "mocap", "truth", "wheels"], typer.Option(help="what the board's motion is taken from")
    ] = "any",
    rig: Annotated[str, typer.Option(help="a simulated rig's name or a path to a .toml")] = "sim",
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
            raise ConfigError(f'rig "{rig}" has real devices: a recorded flight is flown again in simulation')
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


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(refly)
