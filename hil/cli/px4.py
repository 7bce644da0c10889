"""`perch-hil px4`: the software PX4 alone on UDP, for other programs."""

from __future__ import annotations

import math
import signal
import threading
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.options import COULD_NOT_RUN, fail

if TYPE_CHECKING:
    from hil.host.standalone import StandalonePx4

_LISTEN = "where the client listens, as MAVSDK is given it; udp://:0: PX4 waits for it on a free port"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("px4")(px4)


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
