"""`perch-hil campaign plan` and `draw`: how many flights a difference takes, and real flights in a random order."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.options import POLICIES, Json, Rig, fail


def plan(
    effect: Annotated[float, typer.Option(help="the difference of two rates that is to be shown, as a share")] = 0.05,
    power: Annotated[float, typer.Option(help="the probability with which it is to be shown, if it is there")] = 0.8,
    rate: Annotated[float, typer.Option(help="the rate that is required, as a share")] = 0.9,
    differing: Annotated[
        float, typer.Option(help="the share of the seeds on which two policies differ; no less than the effect")
    ] = 0.1,
    comparisons: Annotated[int, typer.Option(min=1, help="scenarios times policies that are tested (Holm)")] = 1,
    confidence: Annotated[float, typer.Option(help="of the tests, between 0 and 1")] = 0.95,
    as_json: Json = False,
) -> None:
    """Say how many flights show a difference: from a required rate, and of two policies on the same seeds."""
    from hil.campaign.power import flights_for, pair_power, single_power
    from hil.cli.screen import print_json, say

    shares = {"effect": effect, "power": power, "rate": rate, "differing": differing, "confidence": confidence}
    for name, value in shares.items():
        if not 0.0 < value < 1.0:
            raise fail(f"--{name} {value:g}: give a share between 0 and 1")
    if rate + effect > 1.0:
        raise fail(f"--rate {rate:g} and --effect {effect:g}: a policy cannot be better than 1")
    each = 1.0 - (1.0 - confidence) / comparisons
    single = flights_for(lambda count: single_power(count, rate, rate + effect, each), power)
    paired = flights_for(lambda count: pair_power(count, effect, differing, each), power)
    if as_json:
        print_json({**shares, "comparisons": comparisons, "flights": single, "seeds": paired})
        return
    say(f"to show that a policy at {rate + effect:g} is above {rate:g}: {_said(single)} flights of each scenario")
    say(f"to show a gain of {effect:g} over another policy on the same seeds: {_said(paired)} seeds of each scenario")


def _said(count: int | None) -> str:
    return "more than 100000" if count is None else str(count)


def draw(
    scenarios: Annotated[list[str], typer.Argument(help="names or .toml files")],
    rig: Rig,
    policy: Annotated[list[str], typer.Option(help=f"{POLICIES} or PATH.onnx; repeated")],
    out: Annotated[Path, typer.Option(help="file for the list; never overwritten")],
    flights: Annotated[int, typer.Option(min=1, max=1000, help="of each scenario with each policy")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="of the order")] = 0,
) -> None:
    """Draw the order of real flights, and seal it, before the first is flown."""
    import itertools
    import json

    from hil.assembly.plan import Plan
    from hil.campaign.draw import draw_list
    from kernel.toml_errors import ConfigError
    from policies.flying.contract import ContractError
    from scenarios.spec import load

    try:
        names = [load(scenario).name for scenario in scenarios]
        for kind, given in (("scenario", names), ("policy", policy)):
            twice = sorted({name for name in given if given.count(name) > 1})
            if twice:
                raise ConfigError(f"{kind} {', '.join(twice)} is given twice: --flights says how often each is flown")
        for scenario, one in itertools.product(scenarios, policy):
            Plan(scenario, rig, one, None, live=True)  # what could not be flown is not drawn
        listed = draw_list(names, policy, flights, rig, seed)
        with out.open("x", encoding="utf-8") as file:
            file.write(json.dumps(listed, indent=2) + "\n")
    except (ConfigError, ContractError, ValueError) as error:
        raise fail(str(error)) from None
    except OSError as error:
        raise fail(f"{out}: cannot be written: {error.strerror}") from None
    print(f"wrote {out}: {len(listed['flights'])} flights, sealed by {listed['sha256'][:12]}")
