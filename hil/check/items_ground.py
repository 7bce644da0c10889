"""Automatic checks of a real autopilot on the ground station's link."""

from __future__ import annotations

from hil.bench.devices import Context
from hil.check.judge import Reading
from hil.check.registry import check

_CALIBRATION = "calibration"


@check("ground.calibration", unit="sensors")
def calibration(context: Context) -> Reading:
    """Sensors that are not calibrated, by the autopilot's own health."""
    checks = context.station().checks
    missing = [name for name, fine in checks.items() if name.endswith(_CALIBRATION) and not fine]
    return Reading(len(missing), ", ".join(missing), context.rig.vehicle.ground_url)


@check("ground.health")
def health(context: Context) -> Reading:
    """The autopilot would arm now; if not, why, in the words of its events and texts."""
    found = context.station()
    return Reading(found.armable, "; ".join(found.reasons()), context.rig.vehicle.ground_url, ok=found.armable)
