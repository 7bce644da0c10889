"""Commands of the bus: `keys`, `hub`, `node`, `status`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console

from hil.cli.options import COULD_NOT_RUN, fail

if TYPE_CHECKING:
    from hil.bus.leaf import Credentials

_ENDPOINT = "tcp/127.0.0.1:7447"
_Keys = Annotated[Path | None, typer.Option(help="folder of `perch-hil keys`: the bus is closed, on tls/")]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    for command in (keys, hub, node, status):
        app.command(command.__name__)(command)


def _default_endpoint(keys: Path | None) -> str:
    return _ENDPOINT if keys is None else _ENDPOINT.replace("tcp/", "tls/")


def _credentials(keys: Path | None, identity: str) -> Credentials | None:
    from hil.bus.leaf import credentials_in

    return None if keys is None else credentials_in(keys, identity)


def keys(
    folder: Annotated[Path, typer.Argument(help="a new folder")],
    host: Annotated[
        list[str] | None, typer.Option(help="address or name at which other hosts reach the hub; may be repeated")
    ] = None,
) -> None:
    """Make the keys and certificates that close a bus: one authority, and one identity a service.

    Give a host ca.crt and the .crt and .key of what it runs; keep ca.key away from all of them.
    """
    from hil.assembly.node_table import SERVICES
    from hil.bus.certificates import DAYS, KeysError, make_keys
    from hil.bus.leaf import OBSERVERS

    try:
        files = make_keys(folder, ["hub", *OBSERVERS, *SERVICES], host or ())
    except KeysError as error:
        raise fail(str(error)) from None
    print(f"{len(files)} files in {folder}, valid for {DAYS} days: perch-hil run SCENARIO --live --keys {folder}")
    print(f"keep {folder / 'ca.key'} in a safe place: whoever has it can join as anybody")


def hub(
    listen: Annotated[
        str | None, typer.Option(help=f"tcp/HOST:PORT; this host's address lets others in [default: {_ENDPOINT}]")
    ] = None,
    keys: _Keys = None,
    rig: Annotated[str, typer.Option(help="with --keys: whose services are let in, and what each may read")] = "sim",
) -> None:
    """Serve the bus until Ctrl-C. Without --keys everybody who can reach the port can use it."""
    from hil.assembly.node_table import service_nodes
    from hil.assembly.rig import load_rig
    from hil.bus.keys import access_control
    from hil.bus.leaf import BusError
    from hil.live.hub import serve_hub
    from hil.live.options import check_endpoint, check_identities

    endpoint = listen or _default_endpoint(keys)
    try:
        check_endpoint(endpoint, keys)
        check_identities(keys, ["hub"])
        access = access_control(service_nodes(load_rig(rig))) if keys is not None else None
        print(f"hub on {endpoint}, end it with Ctrl-C", file=sys.stderr)
        serve_hub(endpoint, _credentials(keys, "hub"), access, with_parent=False)
    except ValueError as error:
        raise fail(str(error)) from None
    except BusError as error:
        raise fail(str(error), COULD_NOT_RUN) from None


def node(
    service: Annotated[str, typer.Argument(help="a service of the rig: brain, detector, camera, ...")],
    scenario: Annotated[str, typer.Option(help="the run's scenario")],
    rig: Annotated[str, typer.Option(help="the run's rig")] = "sim",
    seed: Annotated[int, typer.Option(help="the run's seed")] = 0,
    policy: Annotated[str | None, typer.Option(help="the run's policy [default: the rig's]")] = None,
    camera: Annotated[Literal["pictures", "model"] | None, typer.Option(help="the run's camera")] = None,
    connect: Annotated[str | None, typer.Option(help=f"the hub's endpoint [default: {_ENDPOINT}]")] = None,
    keys: _Keys = None,
    wait: Annotated[float, typer.Option(min=1, max=3600, help="how long to wait for the hub, s")] = 60.0,
    receipts: Annotated[
        Path | None, typer.Option(help="folder for its receipts, which `perch-hil replay` wants in the run's folder")
    ] = None,
) -> None:
    """Serve one piece of a live run on this host, for one run started elsewhere with --remote.

    Exit code: 0 the run is over, 2 usage or configuration, 3 no hub, the run's host was lost, or a device is not there.
    """
    from hil.bus.leaf import BusError
    from hil.live.main import serve
    from hil.live.options import check_endpoint, check_identities, check_service
    from hil.live.spec import LiveSpec
    from hil.live.wires import free_ports
    from hil.recording.recorder import RecordingError
    from hil.wires import WireError

    endpoint = connect or _default_endpoint(keys)
    try:
        check_endpoint(endpoint, keys)
        spec = LiveSpec(
            scenario=scenario, rig=rig, policy=policy, camera=camera, seed=seed, endpoint=endpoint, ports=free_ports(),
            pictures="none", folder=receipts, keys=keys,
        )  # fmt: skip
        plan = spec.plan()
        check_service(plan.rig, service)
        check_identities(keys, [service])
        if receipts is not None:
            receipts.mkdir(parents=True, exist_ok=True)
        code = serve(spec, service, spec.services(plan.rig)[service], remote=True, wait_s=wait)
    except ValueError as error:
        raise fail(str(error)) from None
    except (BusError, WireError, OSError, RecordingError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    raise typer.Exit(code)


def status(
    connect: Annotated[str | None, typer.Option(help=f"the hub's endpoint [default: {_ENDPOINT}]")] = None,
    seconds: Annotated[float, typer.Option(min=0.5, max=60, help="how long to listen")] = 2.0,
    keys: _Keys = None,
) -> None:
    """Who is up on a bus, and every topic's rate and age against the contract.

    Exit code: 0 if every topic that is published keeps its age, 1 if one does not, 3 without a hub.
    """
    from hil.bus.leaf import BusError
    from hil.bus.status import listen, status_tables
    from hil.live.options import check_endpoint, check_identities

    endpoint = connect or _default_endpoint(keys)
    try:
        check_endpoint(endpoint, keys)
        check_identities(keys, ["status"])
        seen = listen(endpoint, seconds, _credentials(keys, "status"))
    except ValueError as error:
        raise fail(str(error)) from None
    except BusError as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    for table in status_tables(seen):
        Console().print(table)
    raise typer.Exit(0 if seen.fresh else 1)
