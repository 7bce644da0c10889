"""Sessions of the bus: a Zenoh hub on an explicit endpoint, and client leaves; automatic discovery is off.

The messages sent over them are in `hil/bus/leaf.py`.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, NamedTuple

import zenoh

from hil.bus.clock import answer_clock


class BusError(RuntimeError):
    """The bus cannot be used; the text states why and how to correct it."""


class Credentials(NamedTuple):
    """Files of one identity (PEM): the authority's certificate, own certificate, own key."""

    authority: Path
    certificate: Path
    key: Path


def credentials_in(folder: Path, identity: str) -> Credentials:
    """Where the files of `identity` lie in a folder of `perch-hil bus keys`."""
    return Credentials(folder / "ca.crt", folder / f"{identity}.crt", folder / f"{identity}.key")


# The default's five threads a process wake each other for every message: a fifth of all the processor time of a live
# run on two cores.
_THREADS = "(rx: (handover: app), acc: (handover: app), tx: (handover: app), app: (worker_threads: 1))"


def _open(config: zenoh.Config) -> zenoh.Session:
    os.environ.setdefault("ZENOH_RUNTIME", _THREADS)  # read once, when a process opens its first session
    return zenoh.open(config)


def settings(**values: Any) -> zenoh.Config:
    """What hub and leaves have in common, with `values` (path in Zenoh's configuration -> value) on top."""
    config = zenoh.Config()
    for key, value in {
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": True,
        # room for a moment in which a process is not scheduled; with the default of 2 messages are lost by then
        "transport/link/tx/queue/size/real_time": 16,
        "transport/link/tx/queue/size/data": 16,
        "transport/link/tx/queue/batching/time_limit": 0,
        # us; the default waits 50 ms for room for a picture, and meanwhile no leaf receives anything from the hub
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 100,
        "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": 2000,
        # bytes; a picture that finds no room there goes through the sockets, in fifteen pieces
        "transport/shared_memory/transport_optimization/pool_size": 64 << 20,
        **values,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _tls(credentials: Credentials | None, side: str) -> dict[str, Any]:
    if credentials is None:
        return {}
    return {
        "transport/link/tls/root_ca_certificate": str(credentials.authority),
        f"transport/link/tls/{side}_certificate": str(credentials.certificate),
        f"transport/link/tls/{side}_private_key": str(credentials.key),
        "transport/link/tls/enable_mtls": True,
    }


def open_hub(
    endpoint: str, credentials: Credentials | None = None, access: dict[str, Any] | None = None
) -> zenoh.Session:
    """The hub, listening on `endpoint` (tcp/HOST:PORT, or tls/HOST:PORT with credentials). Raises BusError.

    `access` is an access-control table (see hil/bus/keys.py). The hub also answers questions for its clock.
    """
    more: dict[str, Any] = {} if access is None else {"access_control": access}
    more |= _tls(credentials, "listen")
    try:
        session = _open(settings(mode="router", **{"listen/endpoints": [endpoint]}, **more))
    except zenoh.ZError as error:
        raise BusError(f"the hub cannot listen on {endpoint}: {_listen_trouble(str(error))}") from None
    answer_clock(session)
    return session


def _listen_trouble(text: str) -> str:
    if "in use" in text:
        return "another hub or program is on that port: stop it, or choose another port"
    if "assign requested address" in text:
        return "this host has no such address (see `ip addr`)"
    return text.splitlines()[0][:160]


def open_leaf(endpoint: str, credentials: Credentials | None = None, timeout_s: float = 5.0) -> zenoh.Session:
    """A client of the hub at `endpoint`. Raises BusError if none answers within `timeout_s`."""
    more = {"connect/endpoints": [endpoint], "connect/timeout_ms": round(timeout_s * 1000)}
    try:
        return _open(settings(mode="client", **more, **_tls(credentials, "connect")))
    except zenoh.ZError:
        hint = ""
        if credentials is not None:
            hint = (
                f", or is {credentials.certificate} of another authority than the hub's, or does the hub's "
                "certificate not name this address (`perch-hil bus keys --host`)?"
            )
        elif endpoint.startswith("tls/"):
            hint = "; one that listens on tls/ lets no process in without --keys"
        raise BusError(f"no hub answers at {endpoint}: start one with `perch-hil bus hub`{hint}") from None
