"""A sum of sines: how a deck pitches or heaves."""

from __future__ import annotations

import math
from collections.abc import Sequence


class Sines:
    """Of terms (amplitude, period s, phase rad); without any it is 0. Raises ValueError for a period that is not
    positive or a number that is not finite."""

    def __init__(self, terms: Sequence[tuple[float, float, float]] = ()) -> None:
        for amplitude, period, phase in terms:
            if not all(map(math.isfinite, (amplitude, period, phase))) or period <= 0.0:
                raise ValueError(f"a sine of amplitude {amplitude}, period {period} s and phase {phase} rad is none")
        self._terms = tuple((amplitude, 2.0 * math.pi / period, phase) for amplitude, period, phase in terms)

    def at(self, seconds: float) -> tuple[float, float]:
        """(value, rate of change a second) at `seconds`."""
        value = rate = 0.0
        for amplitude, frequency, phase in self._terms:
            value += amplitude * math.sin(frequency * seconds + phase)
            rate += amplitude * frequency * math.cos(frequency * seconds + phase)
        return value, rate

    @property
    def most(self) -> float:
        """No value is larger than this."""
        return sum(abs(amplitude) for amplitude, _, _ in self._terms)
