"""All automatic checks by name, for use in checklists."""

from __future__ import annotations

from hil.check import (  # noqa: F401  importing them registers their checks
    items_camera,
    items_car,
    items_crazyflie,
    items_ground,
    items_host,
    items_mocap,
    items_policy,
    items_run,
    items_vehicle,
)
from hil.check.registry import REGISTERED, Check


def checks() -> dict[str, Check]:
    """All registered checks, by name."""
    return dict(sorted(REGISTERED.items()))
