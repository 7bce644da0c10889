"""How a viewer's process joins the bus of a live run: it waits for the hub, and reads."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.bus.leaf import Bus, Mailbox

VIEWER = "viewer"  # of the bus's observers: it reads every topic and may publish nothing
_HUB_S = 60.0  # a live run's hub is started after its viewer


def join(endpoint: str, keys: str, stopped: list[bool], mailbox: Mailbox, topics: Iterable[str]) -> Bus:
    """A leaf of the bus at `endpoint` that puts `topics` into `mailbox`. `keys`: the folder that closes the bus, or
    empty.

    Raises BusError if no hub starts within a minute, or once something is in `stopped`.
    """
    from hil.bus.leaf import Bus, BusError, credentials_in

    until = time.monotonic() + _HUB_S
    while True:
        try:
            bus = Bus(endpoint, credentials_in(Path(keys), VIEWER) if keys else None, timeout_s=1.0, identity=VIEWER)
            break
        except BusError:
            if stopped or time.monotonic() > until:
                raise
    bus.subscribe(VIEWER, topics, mailbox)
    return bus
