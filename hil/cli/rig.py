"""`perch-hil rig list|check`: the device in each slot of a rig, and whether it is reachable."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from hil.cli.groups import add_group
from hil.cli.options import COULD_NOT_RUN, OK, Json, fail


def register(app: typer.Typer) -> None:
    """Add the group."""
    add_group(app, "rig", "Rigs: what fills each slot.", {"list": rig_list, "check": rig_check}, flat=False)


def rig_list(as_json: Json = False) -> None:
    """The rigs that come with the project."""
    from hil.assembly.rig import list_rigs, load_rig
    from hil.cli.screen import print_json

    titles = {name: load_rig(name).title for name in list_rigs()}
    if as_json:
        print_json([{"name": name, "title": title} for name, title in titles.items()])
        return
    for name, title in titles.items():
        print(f"{name:10s} {title}")


def rig_check(
    rig: Annotated[str, typer.Argument(help="a rig's name or a path to a .toml")], as_json: Json = False
) -> None:
    """Tell what of a rig is reachable now.

    Sends nothing to a vehicle or car.

    Exit code: 0 everything, 2 usage or configuration, 3 something is not reachable.
    """
    from hil.assembly.rig import load_rig
    from hil.cli.screen import print_json, say
    from hil.live.reach import reach
    from policies.flying.contract import ContractError
    from policies.flying.registry import policy_factory
    from vehicle.quadrotor.airframe import load_airframe

    try:
        read = load_rig(rig)
        policy_factory(read.policy.kind, load_airframe(read.vehicle.airframe), guidance=read.policy.guidance)
    except (ContractError, ValueError) as error:
        raise fail(str(error)) from None
    found = reach(read)
    if as_json:
        print_json([asdict(slot) for slot in found])
    else:
        for slot in found:
            say(f"{slot.slot:10s} {slot.kind:10s} {'ok' if slot.ok else 'NOT REACHABLE':14s} {slot.text}")
    raise typer.Exit(OK if all(slot.ok for slot in found) else COULD_NOT_RUN)
