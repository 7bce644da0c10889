"""The hub's process: routes, tells its clock, and ends with whoever started it."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any

from hil.bus import Credentials, open_hub
from hil.host.live_spec import LiveSpec
from hil.keys import access_control


def hub(spec: LiveSpec) -> int:
    """Serve until SIGTERM, or until the parent process is gone. Raises BusError if the endpoint cannot be had."""
    access = access_control(spec.services()) if spec.keys is not None else None
    serve_hub(spec.endpoint, spec.credentials("hub"), access, with_parent=True)
    return 0


def serve_hub(
    endpoint: str, credentials: Credentials | None, access: dict[str, Any] | None, *, with_parent: bool
) -> None:
    """The same on any endpoint."""
    done = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: done.set())
    parent = os.getppid()
    with open_hub(endpoint, credentials, access):
        while not done.wait(0.5):
            # the leaves notice by themselves; a little later, so that their last words still get through
            if with_parent and os.getppid() != parent:
                done.wait(25.0)
                return
