"""Commands around live runs: `rig`, `replay`. Those of the bus: hil/cli/bus.py."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hil.cli import bus as cli_bus
from hil.cli.options import COULD_NOT_RUN, fail


def register(app: typer.Typer) -> None:
    """Add the commands."""
    cli_bus.register(app)
    app.command("replay")(replay)
    app.command("soak")(soak)
    rigs = typer.Typer(no_args_is_help=True, help="Rigs: what fills each slot.")
    rigs.command("check")(rig_check)
    rigs.command("list")(rig_list)
    app.add_typer(rigs, name="rig")


def replay(
    run: Annotated[Path, typer.Argument(help="a run folder, of either host")],
    nodes: Annotated[list[str] | None, typer.Option("--node", help="which nodes [default: all that can be]")] = None,
    tolerance: Annotated[float, typer.Option(min=0, help="difference of numbers that counts as none")] = 0.0,
    ignore: Annotated[list[str] | None, typer.Option(help="topic, or topic.field, not to be compared")] = None,
    policy: Annotated[str | None, typer.Option(help="another policy in place of the run's")] = None,
) -> None:
    """Step nodes of a recorded run again, with today's code, on what each step consumed then.

    Exit code: 0 nothing differs, 1 something does, 2 the run cannot be replayed.
    """
    from hil.host.replay import ReplayError, replay_run
    from hil.recording.reader import ReadError
    from hil.recording.runs import RunError

    try:
        found = replay_run(run, nodes or (), tolerance=tolerance, ignore=ignore or (), policy=policy)
    except (ReplayError, RunError, ReadError, ValueError) as error:
        raise fail(str(error)) from None
    print("\n".join(found.lines()))
    raise typer.Exit(0 if found.same else 1)


def soak(
    minutes: Annotated[float, typer.Option(min=1.5, max=24 * 60, help="how long the vehicle hovers")] = 10.0,
    scenario: Annotated[str, typer.Option(help="what is then flown")] = "hard-i",
    out: Annotated[Path, typer.Option(help="where the run's folder goes")] = Path("runs"),
) -> None:
    """One long live run, everything simulated: is memory flat in every service, does nobody fall behind more and more?

    Exit code: 0 so it is, 1 not, 2 usage, 3 could not run.
    """
    from hil.live.soak import soak as run_soak
    from hil.live.soak import table
    from hil.live.supervisor import SupervisorError
    from hil.recording.recorder import RecordingError
    from hil.recording.runs import RunError

    try:
        verdicts, trouble, folder = run_soak(scenario, minutes, out)
    except ValueError as error:
        raise fail(str(error)) from None
    except (RunError, RecordingError, SupervisorError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    Console().print(table(verdicts))
    print(f"run folder: {folder}")
    if trouble:
        raise fail(f"the soak did not end by itself: {trouble}", COULD_NOT_RUN)
    bad = [one.service for one in verdicts if one.faults]
    print(f"soak of {minutes:g} min: " + (f"NOT flat: {', '.join(bad)}" if bad else "memory flat, no growing lateness"))
    raise typer.Exit(1 if bad else 0)


def rig_list() -> None:
    """The rigs that come with the project."""
    from hil.assembly.rig import list_rigs, load_rig

    for name in list_rigs():
        print(f"{name:10s} {load_rig(name).title}")


def rig_check(rig: Annotated[str, typer.Argument(help="a rig's name or a path to a .toml")]) -> None:
    """Tell what of a rig is reachable now, before anything arms. Sends nothing to a vehicle or car.

    Exit code: 0 everything, 3 something is not reachable.
    """
    from hil.assembly.rig import load_rig
    from hil.live.reach import reach
    from kernel.toml_errors import ConfigError

    try:
        found = reach(load_rig(rig))
    except ConfigError as error:
        raise fail(str(error)) from None
    for slot in found:
        print(f"{slot.slot:10s} {slot.kind:10s} {'ok' if slot.ok else 'NOT REACHABLE':14s} {slot.text}")
    raise typer.Exit(0 if all(slot.ok for slot in found) else COULD_NOT_RUN)
