"""`perch-hil bus keys|hub|node|status`: the bus of a live run that spans hosts or is closed."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from hil.cli.groups import add_group
from hil.cli.options import (
    COULD_NOT_RUN,
    DIFFERENT,
    OK,
    POLICIES,
    Camera,
    Endpoint,
    Json,
    Keys,
    Rig,
    ScenarioRig,
    credentials,
    fail,
    hub_endpoint,
)


def register(app: typer.Typer) -> None:
    """Add the group."""
    commands = {"keys": keys, "hub": hub, "node": node, "status": status}
    add_group(app, "bus", "A live run's bus: keys, hub, services on other hosts, status.", commands)


def keys(
    folder: Annotated[Path, typer.Argument(help="a new folder")],
    host: Annotated[
        list[str] | None, typer.Option(help="address or name at which other hosts reach the hub; may be repeated")
    ] = None,
) -> None:
    """Make the keys and certificates that close a bus.

    One authority, and one identity for each service.
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
    print(f"keep {folder / 'ca.key'} in a safe place: it signs certificates for any identity on this bus")


def hub(
    endpoint: Endpoint = None,
    keys: Keys = None,
    rig: Rig = "sim",
) -> None:
    """Serve the bus until Ctrl-C.

    Without --keys it is open to every process that can reach the port.

    With --keys only the services of --rig are let in, and each reads and writes only what the table of topics allows.

    Exit code: 0 ended by Ctrl-C, 2 usage or configuration, 3 the address cannot be served.
    """
    from hil.assembly.node_table import service_nodes
    from hil.assembly.rig import load_rig
    from hil.bus.keys import access_control
    from hil.bus.leaf import BusError
    from hil.bus.session import no_shared_memory
    from hil.live.hub import serve_hub

    try:
        address, own = hub_endpoint(endpoint, keys), credentials(keys, ["hub"])
        asked = load_rig(rig)
        access = access_control(service_nodes(asked), asked.policy.knows) if keys is not None else None
        for line in filter(None, (no_shared_memory(), f"hub on {address}, end it with Ctrl-C")):
            print(line, file=sys.stderr)
        serve_hub(address, own, access, with_parent=False)
    except ValueError as error:
        raise fail(str(error)) from None
    except BusError as error:
        raise fail(str(error), COULD_NOT_RUN) from None


def node(
    service: Annotated[str, typer.Argument(help="a service of the rig: brain, detector, camera, ...")],
    scenario: Annotated[str, typer.Option(help="the run's scenario")],
    rig: ScenarioRig = None,
    seed: Annotated[int, typer.Option(help="the run's seed")] = 0,
    policy: Annotated[
        str | None, typer.Option(help=f"the run's policy: {POLICIES} or PATH.onnx [default: the rig's]")
    ] = None,
    camera: Camera = None,
    endpoint: Endpoint = None,
    keys: Keys = None,
    wait: Annotated[float, typer.Option(min=1, max=3600, help="how long to wait for the hub, s")] = 60.0,
    receipts: Annotated[
        Path | None,
        typer.Option(help="folder for its receipts, which `perch-hil runs replay` needs in the run's folder"),
    ] = None,
) -> None:
    """Serve one service of a run that another host started.

    That run names it by --remote.
    Scenario, rig, seed, policy and camera must be the run's: it refuses others.

    Exit code: 0 the run is over, 2 usage or configuration, 3 no hub, the run's host was lost, or a device is not there.
    """
    from hil.assembly.plan import Plan
    from hil.bus.leaf import BusError
    from hil.bus.session import no_shared_memory
    from hil.live.main import serve
    from hil.live.options import check_identities, check_service
    from hil.live.spec import LiveSpec
    from hil.live.wires import free_ports
    from hil.recording.provenance import ProvenanceError
    from hil.recording.recorder import RecordingError
    from hil.wires import WireError

    try:
        plan = Plan(scenario, rig, policy, camera, live=True)
        spec = LiveSpec(
            scenario=scenario, rig=rig, policy=policy, camera=camera, seed=seed, endpoint=hub_endpoint(endpoint, keys),
            ports=free_ports(plan.rig), pictures="none", folder=receipts, keys=keys,
        )  # fmt: skip
        check_service(plan.rig, service)
        check_identities(keys, [service])
        if service == "brain":
            plan.check_latency(time.perf_counter)
        if receipts is not None:
            receipts.mkdir(parents=True, exist_ok=True)
        if no_shared_memory():
            print(no_shared_memory(), file=sys.stderr)
        code = serve(spec, service, spec.services(plan.rig)[service], remote=True, wait_s=wait)
    except ValueError as error:
        raise fail(str(error)) from None
    except (BusError, WireError, OSError, RecordingError, ProvenanceError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    raise typer.Exit(code)


def status(
    endpoint: Endpoint = None,
    seconds: Annotated[float, typer.Option(min=0.5, max=60, help="how long to listen")] = 2.0,
    keys: Keys = None,
    as_json: Json = False,
) -> None:
    """List services, and every topic's rate and age.

    Rates and ages stand beside what the table of topics asks for.

    Exit code: 0 if every topic that is published keeps its age, 1 if one does not, 2 usage, 3 without a hub.
    """
    from hil.bus.leaf import BusError
    from hil.bus.status import listen, status_tables
    from hil.cli.screen import print_json, screen

    try:
        seen = listen(hub_endpoint(endpoint, keys), seconds, credentials(keys, ["status"]))
    except ValueError as error:
        raise fail(str(error)) from None
    except BusError as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    if as_json:
        topics = {name: {"hz": hz, "age_ms": age} for name, (hz, age) in seen.topics.items()}
        print_json({"fresh": seen.fresh, "services": seen.services, "topics": topics})
    else:
        for table in status_tables(seen):
            screen().print(table)
    raise typer.Exit(OK if seen.fresh else DIFFERENT)
