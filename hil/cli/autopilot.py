"""`perch-hil px4`: the software PX4 alone on UDP. `perch-hil vehicle`: an autopilot on the ground station's link."""

from __future__ import annotations

import math
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.groups import add_group
from hil.cli.options import COULD_NOT_RUN, DIFFERENT, OK, Json, fail

if TYPE_CHECKING:
    from hil.bench.ground import GroundStation
    from hil.host.standalone import StandalonePx4

Link = Annotated[str, typer.Option(help="ground station's link: udp://:14550, tcp://HOST:PORT, serial:///dev/ttyACM0")]
System = Annotated[
    int, typer.Option(min=0, max=255, help="MAV_SYS_ID of the autopilot ; 0: the only one that is heard")
]
_LINK = "udp://:14550"
_LISTEN = "where the client listens, as MAVSDK is given it; udp://:0: PX4 waits for it on a free port"


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("px4")(px4)
    commands = {"health": health, "logs": logs, "log": log, "set": set_parameter, "reboot": reboot}
    text = "A real autopilot on the ground: health, logs, parameters, reboot. Never arms."
    add_group(app, "vehicle", text, commands, flat=False)


def px4(
    listen: Annotated[str, typer.Option(help=_LISTEN)] = "udp://:14540",
    gcs: Annotated[str, typer.Option(help="where the ground station listens; none: no such link")] = "udp://:14550",
    airframe: Annotated[str, typer.Option(help="name, or PATH.toml")] = "sih_quad",
    speed: Annotated[str, typer.Option(help="PX4's time over wall time, or max: as fast as this computer can")] = "1",
    seed: Annotated[int, typer.Option(min=0, help="of the sensors' noise")] = 0,
    param: Annotated[list[str] | None, typer.Option(help="NAME=VALUE, set before it boots; may be repeated")] = None,
) -> None:
    """A software PX4 for MAVSDK, QGroundControl or your own code.

    One quadrotor on the ground; nothing else is simulated. It runs until Ctrl-C or SIGTERM.

    Exit code: 0 ended, 2 usage, 3 a port cannot be used.
    """
    from hil.host.standalone import GROUND, OFFBOARD, StandalonePx4, link_address
    from hil.wires import WireError

    try:
        factor = _speed(speed)
        parameters = dict(map(_parameter, param or ()))
        offboard = link_address(listen, OFFBOARD)
        ground = None if gcs == "none" else link_address(gcs, GROUND)
    except (ValueError, WireError) as error:
        raise fail(str(error)) from None
    try:
        autopilot = StandalonePx4(airframe, offboard=offboard, ground=ground, seed=seed, parameters=parameters)
    except ValueError as error:
        raise fail(str(error)) from None
    except WireError as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    _serve(autopilot, factor)


def _serve(autopilot: StandalonePx4, speed: float) -> None:
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    for name, wire in (("offboard link", autopilot.offboard), ("ground station", autopilot.ground)):
        if wire is not None:
            to = f"sends to {wire.peer[0]}:{wire.peer[1]}" if wire.peer else "waits for a client"
            print(f"{name}: PX4 at {wire.address[0]}:{wire.address[1]} {to}", flush=True)
    pace = "as fast as it goes" if math.isinf(speed) else f"{speed:g} s a second"
    print(f"PX4's time: {pace}; end it with Ctrl-C", flush=True)
    autopilot.start(speed)
    while autopilot.failure is None and not ended.wait(0.2):
        pass
    autopilot.close()


def _speed(text: str) -> float:
    try:
        speed = math.inf if text == "max" else float(text)
    except ValueError:
        speed = math.nan
    if text != "max" and not 0.01 <= speed <= 100.0:
        raise ValueError(f"--speed {text}: give 0.01 to 100 (1 is real time), or max")
    return speed


def _parameter(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not name or not math.isfinite(number):
        raise ValueError(f"--param {text}: write NAME=VALUE with a number, such as MIS_TAKEOFF_ALT=5")
    return name, number


@contextmanager
def _station(link: str, system: int) -> Iterator[GroundStation]:
    """A connection; what it cannot do ends the command in one line."""
    from hil.bench.ground import GroundStation, Refused
    from hil.bench.reading import Unavailable

    try:
        with GroundStation(link, system) as station:
            yield station
    except Refused as error:
        raise fail(str(error), DIFFERENT) from None
    except Unavailable as error:
        raise fail(str(error), COULD_NOT_RUN) from None


def health(link: Link = _LINK, system: System = 0, as_json: Json = False) -> None:
    """The autopilot's own checks, and why it would not arm.

    The reasons are PX4's events in words where the autopilot has their texts, else what it sends as text.

    Exit code: 0 it would arm, 1 it would not, 3 it does not answer.
    """
    from hil.cli.screen import print_json, say

    with _station(link, system) as station:
        found = station.health()
    if as_json:
        problems = [one._asdict() for one in found.problems]
        print_json({"armable": found.armable, "checks": found.checks, "reasons": found.reasons(), "problems": problems})
    else:
        for name, fine in found.checks.items():
            say(f"{name:26s} {'ok' if fine else 'NOT OK'}")
        for reason in found.reasons():
            say(f"not armed because: {reason}")
        for one in found.problems:
            say(f"{one.level}: {one.text} ({one.component}){f': {one.detail}' if one.detail else ''}")
        if not found.events:
            say("no report of PX4's events: the autopilot does not give their texts")
    raise typer.Exit(OK if found.armable else DIFFERENT)


def logs(link: Link = _LINK, system: System = 0, as_json: Json = False) -> None:
    """List the autopilot's own logs, oldest first."""
    from hil.cli.screen import print_json, say

    with _station(link, system) as station:
        found = station.logs()
    if as_json:
        print_json([one._asdict() for one in found])
        return
    for one in found:
        say(f"{one.id:4d}  {one.utc:20s}  {one.size / 1e6:8.2f} MB")
    say(f"{len(found)} log{'' if len(found) == 1 else 's'}")


def log(
    run: Annotated[Path, typer.Argument(help="the run's folder, whose report then shows the log, or a .ulg to write")],
    number: Annotated[int | None, typer.Option("--id", help="which log [default: the newest]")] = None,
    link: Link = _LINK,
    system: System = 0,
) -> None:
    """Fetch one of the autopilot's own logs.

    A download that is cut off leaves nothing behind and begins anew.

    Exit code: 0 fetched, or already there, 1 it has no such log, 2 usage, 3 it does not answer or it could not write.
    """
    from hil.bench.flight_log import LOG

    path = run if run.suffix == ".ulg" else run / LOG
    if not path.parent.is_dir():
        raise fail(f"{path.parent}: there is no such folder")
    with _station(link, system) as station:
        found = station.logs()
        entry = next((one for one in reversed(found) if number in (None, one.id)), None)
        if entry is None:
            raise fail(f"the autopilot has no log{'' if number is None else f' {number}'}", DIFFERENT)
        if path.exists() and path.stat().st_size == entry.size:
            print(f"{path} is there already ({entry.size / 1e6:.2f} MB)")
            return
        try:
            station.download(entry, path, _show)
        except OSError as error:
            raise fail(f"{path}: cannot be written: {error.strerror}", COULD_NOT_RUN) from None
    print(f"wrote {path} ({entry.size / 1e6:.2f} MB, log {entry.id} of {entry.utc})")


def _show(share: float) -> None:
    """Progress, on a terminal only."""
    if sys.stderr.isatty():
        print(f"\r{100 * share:5.1f} %", end="\n" if share >= 1.0 else "", file=sys.stderr, flush=True)


def set_parameter(
    name: Annotated[str, typer.Argument(help="PX4's name")],
    value: Annotated[float, typer.Argument(help="the new value")],
    link: Link = _LINK,
    system: System = 0,
) -> None:
    """Set one parameter of a disarmed autopilot, and read it back.

    A negative value is written after `--`.

    Exit code: 0 set, 1 refused, 3 it does not answer.
    """
    with _station(link, system) as station:
        before, after = station.set_parameter(name, value)
    print(f"{name}: {before:.7g} -> {after:.7g}")


def reboot(link: Link = _LINK, system: System = 0) -> None:
    """Restart a disarmed autopilot.

    Exit code: 0 it restarts, 1 refused, 3 it does not answer.
    """
    with _station(link, system) as station:
        station.reboot()
    print("it restarts")
