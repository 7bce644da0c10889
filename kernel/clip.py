"""Clipping and checks of numbers that may not be finite.

Python's `min(high, max(low, x))` turns NaN into a bound: a broken number would become the largest command. `clip` keeps
NaN, and `command_within` makes NaN of infinity too, so that a later check sees what was wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from kernel.jit import njit

LARGEST = 1e6  # in SI units: no coordinate, speed, angle, rate or variance here comes near it


@njit(forceinline=True)
def clip(value, low, high):
    """`value` limited to [low, high]; NaN stays NaN."""
    if value < low:
        return low
    if value > high:
        return high
    return value


@njit(forceinline=True)
def command_within(value, low, high):
    """`value` of a command limited to [low, high]; NaN if it is not finite, because that is no command."""
    return clip(value, low, high) if math.isfinite(value) else math.nan


def usable(numbers: Iterable[float]) -> bool:
    """Whether all of `numbers` are finite and none is beyond LARGEST, from where on sums of squares overflow."""
    return all(abs(number) < LARGEST for number in numbers)  # False for NaN
