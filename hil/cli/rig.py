"""`perch-hil rig list|check`: the device in each slot of a rig, and whether it is reachable; `perch-hil camera
calibrate`: the table of its camera."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer

from hil.cli.groups import add_group
from hil.cli.options import COULD_NOT_RUN, DIFFERENT, OK, Json, complain, fail


def register(app: typer.Typer) -> None:
    """Add the groups."""
    add_group(app, "rig", "Rigs: what fills each slot.", {"list": rig_list, "check": rig_check}, flat=False)
    add_group(app, "camera", "Cameras: calibrate one.", {"calibrate": calibrate}, flat=False)


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
    from hil.assembly.plan import rig_policy
    from hil.assembly.rig import load_rig
    from hil.cli.screen import print_json, say
    from hil.live.reach import reach
    from policies.flying.contract import ContractError

    try:
        read = load_rig(rig)
        rig_policy(read.policy.kind, read)
    except (ContractError, ValueError) as error:
        raise fail(str(error)) from None
    found = reach(read)
    if as_json:
        print_json([asdict(slot) for slot in found])
    else:
        for slot in found:
            say(f"{slot.slot:10s} {slot.kind:10s} {'ok' if slot.ok else 'NOT REACHABLE':14s} {slot.text}")
    raise typer.Exit(OK if all(slot.ok for slot in found) else COULD_NOT_RUN)


def calibrate(
    pictures: Annotated[list[Path], typer.Argument(help="pictures of the board, or folders of them")],
    model: Annotated[
        Literal["pinhole", "rational", "fisheye", "none"],
        typer.Option(help="distortion: pinhole (5 numbers), rational (8, wide lenses), fisheye (4), none"),
    ] = "pinhole",
    out: Annotated[Path | None, typer.Option(help="file to write the table to [default: printed]")] = None,
) -> None:
    """Calibrate a camera with the ChArUco board.

    Print it with `perch-hil board --charuco`, glue it flat, and take 20 pictures or more: from all sides, tilted by up
    to 45 deg, in every corner of the picture. Says the reprojection error, and how much of the picture was covered.

    Exit code: 0 a good calibration, 1 written, but not good, 2 no calibration from these pictures, 3 could not write.
    """
    from hil.bench.calibration import doubts, look, solve, table
    from vehicle.camera.calibrate import CalibrationError

    try:
        seen = look(pictures)
        done = solve(seen, model)
    except CalibrationError as error:
        raise fail(str(error)) from None
    if out is None:
        print(table(done), end="")
    else:
        try:
            out.write_text(table(done), encoding="utf-8")
        except OSError as error:
            raise fail(f"{out}: cannot be written: {error.strerror}", COULD_NOT_RUN) from None
        print(f"wrote {out}: put the table into the rig")
    if seen.unseen:
        complain(f"board not found in {', '.join(seen.unseen)}")
    doubtful = doubts(done)
    for line in doubtful:
        complain(line)
    raise typer.Exit(DIFFERENT if doubtful else OK)
