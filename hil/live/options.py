"""Checks the options of a live run for consistency before a process is started."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from hil.assembly.node_table import service_nodes
from hil.assembly.rig import Rig
from hil.bus.certificates import check_keys
from hil.bus.leaf import credentials_in
from kernel.toml_errors import ConfigError, nearest

_ENDPOINT = re.compile(r"(tcp|tls)/(\[[0-9a-fA-F:]+\]|[^/\s:]+):(\d{1,5})")


def check_endpoint(endpoint: str, keys: Path | None) -> None:
    """Raises ConfigError unless `endpoint` is tcp/HOST:PORT, or tls/HOST:PORT with keys."""
    match = _ENDPOINT.fullmatch(endpoint)
    if match is None or not 0 < int(match[3]) < 65536:
        raise ConfigError(f"endpoint {endpoint!r}: write tcp/HOST:PORT, or tls/HOST:PORT with --keys")
    if keys is not None and match[1] != "tls":
        raise ConfigError(f"endpoint {endpoint}: with --keys the bus is on tls/{match[2]}:{match[3]}")
    if keys is None and match[1] == "tls":
        raise ConfigError(f"endpoint {endpoint}: tls/ needs --keys, a folder of `perch-hil bus keys`")


def check_identities(keys: Path | None, identities: Iterable[str]) -> None:
    """Raises KeysError for the first identity whose files are not usable; an open bus needs none."""
    if keys is not None:
        for identity in identities:
            check_keys(credentials_in(keys, identity))


def check_service(rig: Rig, service: str) -> None:
    """Raises ConfigError unless `service` of `rig` can run on another host."""
    known = service_nodes(rig)
    if service not in known:
        raise ConfigError(
            f"this rig has no service {service!r}{nearest(service, list(known))} It has {', '.join(known)}"
        )
    for simulated, tied in (
        (rig.vehicle.simulated, ("vehicle_link", "vehicle_device")),
        (rig.groundcar.kind == "sim", ("car", "car_device")),
    ):
        if simulated and service in tied:
            raise ConfigError(f"{service}: a simulated device and its driver share a wire of one host: not --remote")


def check_options(
    rig: Rig, remote: tuple[str, ...], endpoint: str | None, keys: Path | None, *, viewed: bool = False
) -> None:
    """Checks the options of `run --live`. Raises ConfigError or KeysError."""
    for service in remote:
        if service != "hub":
            check_service(rig, service)
    if remote and endpoint is None:
        raise ConfigError("--remote needs --endpoint, at which the other host reaches the hub: tcp/HOST:PORT")
    if endpoint is not None:
        check_endpoint(endpoint, keys)
    here = [name for name in ("hub", "supervisor", "recorder", *service_nodes(rig)) if name not in remote]
    check_identities(keys, [*here, *(["viewer"] if viewed else [])])
