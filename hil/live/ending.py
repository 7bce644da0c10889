"""Ending a live run in order after a fault: every service that drives a device reaches its safe state."""

from __future__ import annotations

import time
from collections.abc import Callable

from hil.assembly.node_table import driving_services
from hil.live.judge import Ended
from hil.live.supervisor import Supervisor
from hil.scoring.flight_class import LAND_LIMIT_S

TURN_S = 0.05
DRIVERS = driving_services()
_RECEIVED_S = 0.7  # every service publishes its health twice a second
_WITNESS_S = 3.0  # recorded after a driver has ended: what autopilot and car do by themselves


def bring_down(supervisor: Supervisor, ended: Ended) -> None:
    """Bring all services to the safe state; a second Ctrl-C ends the wait. Failures are noted in `ended`."""
    try:
        supervisor.abort(ended.trouble or "interrupted")
        if supervisor.floods is not None:
            supervisor.floods.count_all()
        culprit = ended.trouble.split(" ")[0]
        if culprit == "hub":
            supervisor.drop_hub()
        wait(supervisor, lambda: False, _RECEIVED_S)
        flood = supervisor.floods.fault() if supervisor.floods is not None and ended.trouble else ""
        if flood:  # the cause: what was noticed first may be any service that had no time left
            ended.trouble = f"{flood}; {ended.trouble}"
            supervisor.report("error", flood)
        # a simulated vehicle whose process has ended cannot report that it has landed
        limit_s = _WITNESS_S if culprit == "vehicle_device" else LAND_LIMIT_S
        await_drivers(supervisor, limit_s)
        ended.remarks += [
            f"{driver} did not report within {limit_s:.0f} s that what it drives is safe"
            for driver in DRIVERS
            if driver != culprit and not supervisor.safe(driver)
        ]
        if culprit in DRIVERS:
            wait(supervisor, lambda: False, _WITNESS_S)
    except KeyboardInterrupt:
        ended.interrupted = True


def await_drivers(supervisor: Supervisor, limit_s: float = LAND_LIMIT_S) -> None:
    """Wait until the drivers report that vehicle and car are safe."""
    wait(supervisor, lambda: all(supervisor.safe(driver) for driver in DRIVERS), limit_s)


def wait(supervisor: Supervisor, done: Callable[[], bool], limit_s: float) -> None:
    """Wait until `done`, and keep publishing the supervisor's order meanwhile."""
    until = time.monotonic() + limit_s
    while time.monotonic() < until and not done():
        supervisor.beat()
        time.sleep(TURN_S)
