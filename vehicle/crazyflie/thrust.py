"""Thrust of a Crazyflie 2.1: the measured map from motor voltage to force, and what a thrust word means by it.

The firmware scales a thrust word linearly to force per motor and holds that force while the battery drains; a battery
that cannot give it any more bounds it. The cubic is Bitcraze's measurement of the 2.1+ propellers
(platform_defaults_cf2.h of the firmware).
"""

from __future__ import annotations

from vehicle.crazyflie.commands import FULL_WORD

FULL_FORCE = 0.12  # N per motor at the word 65535
_CUBIC = (-0.02476537915958403, 0.06523793527519485, -0.026792504967750107, 0.006776789303971145)
EMPTY_V = 3.0  # under load; the firmware's criticalLowVoltage


def available_force(battery_v: float) -> float:
    """Force of one motor (N) with all of `battery_v` (V, under load) on it, within what the firmware asks for."""
    c0, c1, c2, c3 = _CUBIC
    force = c0 + battery_v * (c1 + battery_v * (c2 + battery_v * c3))
    return min(FULL_FORCE, max(0.0, force))


def word_of(force: float) -> int:
    """The thrust word (0..65535) for `force` N per motor."""
    return round(min(1.0, max(0.0, force / FULL_FORCE)) * FULL_WORD)


def force_of(word: float) -> float:
    """Force per motor (N) that a thrust word asks for."""
    return word / FULL_WORD * FULL_FORCE
