"""Laws by which a board's inclination and height change during a run: a boat's deck, or a recording."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from scenarios.table import NotNegative, Number, Positive, Table

Terms = tuple[tuple[float, float, float], ...]  # amplitude, period (s), phase (rad)


class InclinationSine(Table):
    """A sine about `inclination_deg`."""

    kind: Literal["sine"]
    amplitude_deg: NotNegative
    period: Positive
    phase_deg: Number = 0.0

    @property
    def terms(self) -> Terms:
        """In rad."""
        return ((math.radians(self.amplitude_deg), self.period, math.radians(self.phase_deg)),)


class InclinationSines(Table):
    """A sum of sines about `inclination_deg`, for a sea state: [amplitude in deg, period in s, phase in deg] each."""

    kind: Literal["sines"]
    terms_deg: Annotated[tuple[tuple[NotNegative, Positive, Number], ...], Field(min_length=1, max_length=32)]

    @property
    def terms(self) -> Terms:
        """In rad."""
        return tuple((math.radians(a), period, math.radians(phase)) for a, period, phase in self.terms_deg)


class HeightSine(Table):
    """A sine about `height`."""

    kind: Literal["sine"]
    amplitude: NotNegative
    period: Positive
    phase_deg: Number = 0.0

    @property
    def terms(self) -> Terms:
        """In m."""
        return ((self.amplitude, self.period, math.radians(self.phase_deg)),)


class HeightSines(Table):
    """A sum of sines about `height`, for a sea state: [amplitude in m, period in s, phase in deg] each."""

    kind: Literal["sines"]
    terms_deg: Annotated[tuple[tuple[NotNegative, Positive, Number], ...], Field(min_length=1, max_length=32)]

    @property
    def terms(self) -> Terms:
        """In m."""
        return tuple((a, period, math.radians(phase)) for a, period, phase in self.terms_deg)


class RecordedLaw(Table):
    """As in the recording of the path."""

    kind: Literal["recorded"]


InclinationLaw = Annotated[InclinationSine | InclinationSines | RecordedLaw, Field(discriminator="kind")]
HeightLaw = Annotated[HeightSine | HeightSines | RecordedLaw, Field(discriminator="kind")]
