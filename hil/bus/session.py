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
# A picture through the sockets is more than a link's queue holds: the hub's only thread would wait for room that it has
# to make itself, and lose every picture of more than 0.8 MB. Sending then has a thread of its own.
_THREADS_FOR_SOCKETS = "(rx: (handover: app), acc: (handover: app), app: (worker_threads: 1))"


def _open(config: zenoh.Config) -> zenoh.Session:
    # read once, when a process opens its first session
    os.environ.setdefault("ZENOH_RUNTIME", _THREADS_FOR_SOCKETS if no_shared_memory() else _THREADS)
    return zenoh.open(config)


_MEMORY = Path("/dev/shm")
_POOL = 64 << 20  # bytes; room for 70 pictures
_MEMORY_NEEDED = 4 * _POOL  # bytes free; the camera's process and the hub have a pool each


def no_shared_memory(folder: Path = _MEMORY) -> str:
    """Why pictures go through the sockets on this computer, with the remedy; empty if they go through shared memory.

    A pool that does not fit is worse than none: Zenoh then loses every picture without a word, or ends the process.
    """
    try:
        found = os.statvfs(folder)
        free = found.f_bavail * found.f_frsize
    except OSError as error:
        return f"pictures go through the sockets, which costs processor time: {folder}: {error.strerror}"
    if free >= _MEMORY_NEEDED:
        return ""
    return (
        f"pictures go through the sockets, which costs processor time: {folder} has {free >> 20} MB free and shared "
        f"memory needs {_MEMORY_NEEDED >> 20} MB (of a container: --shm-size=512m)"
    )


def settings(**values: Any) -> zenoh.Config:
    """What hub and leaves have in common, with `values` (path in Zenoh's configuration -> value) on top."""
    config, without_memory = zenoh.Config(), bool(no_shared_memory())
    for key, value in {
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": not without_memory,
        # room for a moment in which a process is not scheduled; with the default of 2 messages are lost by then
        "transport/link/tx/queue/size/real_time": 16,
        "transport/link/tx/queue/size/data": 16,
        "transport/link/tx/queue/batching/time_limit": 0,
        # us; the default waits 50 ms for room for a picture, and meanwhile no leaf receives anything from the hub
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 100,
        "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": (
            20_000 if without_memory else 2000
        ),
        "transport/shared_memory/transport_optimization/pool_size": _POOL,
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
