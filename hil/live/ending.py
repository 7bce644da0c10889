"""Bringing a live run down in order when something has happened to it: who drives a device reaches its safe state."""

from __future__ import annotations

import time
from collections.abc import Callable

from hil.assembly.node_table import driving_services
from hil.live.judge import Ended
from hil.live.supervisor import Supervisor

TURN_S = 0.05
LAND_LIMIT_S = 25.0
DRIVERS = driving_services()
_HEARD_S = 0.7  # every service says its health twice a second
_WITNESS_S = 3.0  # recorded after the driver itself is gone: what autopilot and car do by themselves


def bring_down(supervisor: Supervisor, ended: Ended) -> None:
    """Everybody to the safe state; a second Ctrl-C cuts it short. What did not come about is remarked in `ended`."""
    try:
        supervisor.abort(ended.trouble or "interrupted")
        who = ended.trouble.split(" ")[0]
        if who == "hub":
            supervisor.drop_hub()
        wait(supervisor, lambda: False, _HEARD_S)
        # of a simulated vehicle that is gone nobody will hear that it has landed
        limit_s = _WITNESS_S if who == "vehicle_device" else LAND_LIMIT_S
        await_drivers(supervisor, limit_s)
        ended.remarks += [
            f"{driver} did not say within {limit_s:.0f} s that what it drives is safe"
            for driver in DRIVERS
            if driver != who and not supervisor.safe(driver)
        ]
        if who in DRIVERS:
            wait(supervisor, lambda: False, _WITNESS_S)
    except KeyboardInterrupt:
        ended.interrupted = True


def await_drivers(supervisor: Supervisor, limit_s: float = LAND_LIMIT_S) -> None:
    """Until vehicle and car are safe, as their drivers say."""
    wait(supervisor, lambda: all(supervisor.safe(driver) for driver in DRIVERS), limit_s)


def wait(supervisor: Supervisor, done: Callable[[], bool], limit_s: float) -> None:
    """Until `done`, staying present for the services."""
    until = time.monotonic() + limit_s
    while time.monotonic() < until and not done():
        supervisor.beat()
        time.sleep(TURN_S)
