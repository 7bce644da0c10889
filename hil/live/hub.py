"""The hub's process: it routes messages, answers clock requests and ends with its parent process."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import nullcontext
from typing import Any

from hil.bus.keys import access_control
from hil.bus.leaf import Credentials, open_hub
from hil.bus.refusals import Refusals
from hil.live.liveness import Presence
from hil.live.priority import drop_priority
from hil.live.spec import LiveSpec

_LINGER_S = 25.0  # the leaves detect it, reach their safe state, and are recorded until then


def hub(spec: LiveSpec) -> int:
    """Serve until SIGTERM, or until the parent process has ended. Raises BusError if the endpoint cannot be used."""
    access = None
    if spec.keys is not None:
        rig = spec.plan().rig
        access = access_control(spec.services(rig), rig.policy.knows)
    serve_hub(spec.endpoint, spec.credentials("hub"), access, with_parent=True)
    return 0


def serve_hub(
    endpoint: str, credentials: Credentials | None, access: dict[str, Any] | None, *, with_parent: bool
) -> None:
    """The same on any endpoint."""
    done, parent, presence = threading.Event(), os.getppid(), Presence()

    def orphaned() -> bool:
        return with_parent and os.getppid() != parent

    def stop(*_: object) -> None:
        if not (with_parent and presence.orphaned_soon()):  # after the parent has ended, the leaves still have to land
            done.set()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)
    port = int(endpoint.rpartition(":")[2])
    with Refusals(port) if credentials is not None else nullcontext(), open_hub(endpoint, credentials, access):
        drop_priority()
        while not done.wait(0.5):
            if orphaned():
                done.wait(_LINGER_S)
                return
