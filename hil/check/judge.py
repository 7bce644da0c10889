"""Computes the outcome of a reading from its limits. Pure: no clock, no I/O."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

Value = bool | int | float | str


class Outcome(StrEnum):
    """Result of an item. PENDING: not reached."""

    PENDING = "PENDING"
    PASS = "PASS"
    MARGINAL = "MARGINAL"
    FAIL = "FAIL"
    UNKNOWN = "UNKNOWN"
    SKIPPED = "SKIPPED"


@dataclass(frozen=True)
class Reading:
    """Result of a check. `ok` is the check's own verdict where limits do not apply; None leaves it to the limits.

    `value` None means that nothing was measured: with limits declared that is a failure. `source`: device
    or file.
    """

    value: Value | None = None
    detail: str = ""
    source: str = ""
    ok: bool | None = None


class Limits(BaseModel):
    """Limits of one item, both ends allowed. Beyond a marginal limit but within the hard one is MARGINAL."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    min: float | None = None
    max: float | None = None
    marginal_min: float | None = None
    marginal_max: float | None = None
    equals: Value | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Limits:
        if self.equals is not None and any(v is not None for v in (self.min, self.max, *self._marginal())):
            raise ValueError("equals and min or max exclude each other")
        steps = [v for v in (self.min, self.marginal_min, self.marginal_max, self.max) if v is not None]
        if steps != sorted(steps):
            raise ValueError("limits must rise: min <= marginal_min <= marginal_max <= max")
        return self

    def _marginal(self) -> tuple[float | None, float | None]:
        return self.marginal_min, self.marginal_max

    @property
    def declared(self) -> bool:
        """True if anything is limited."""
        return any(value is not None for value in self.model_dump().values())

    def text(self, unit: str = "") -> str:
        """Such as `0.2 to 0.5 s` or `at most 5 ms`; empty without limits."""
        tail = f" {unit}" if unit else ""
        if self.equals is not None:
            return f"{self.equals}{tail}"
        low = self.min if self.min is not None else self.marginal_min
        high = self.max if self.max is not None else self.marginal_max
        if low is not None and high is not None:
            return f"{low:g} to {high:g}{tail}"
        if low is not None:
            return f"at least {low:g}{tail}"
        return f"at most {high:g}{tail}" if high is not None else ""


@dataclass(frozen=True)
class Judgement:
    """An outcome, the margin to the nearest hard limit (negative beyond it; None without one), and why."""

    outcome: Outcome
    margin: float | None = None
    reason: str = ""


def judge(reading: Reading, limits: Limits, unit: str = "") -> Judgement:
    """PASS, MARGINAL, FAIL or, for a number that is not finite, UNKNOWN."""
    value = reading.value
    if reading.ok is False:
        return Judgement(Outcome.FAIL, None, reading.detail)
    if value is None:
        if limits.declared:
            return Judgement(Outcome.FAIL, None, "limits are given, but no value was measured")
        if reading.ok is None:
            return Judgement(Outcome.UNKNOWN, None, reading.detail or "nothing was measured")
        return Judgement(Outcome.PASS)
    if isinstance(value, float) and not math.isfinite(value):
        return Judgement(Outcome.UNKNOWN, None, f"the reading is {value}, not a finite number")
    if limits.equals is not None:
        same = _same(value, limits.equals)
        return Judgement(Outcome.PASS if same else Outcome.FAIL, None, "" if same else f"must be {limits.equals}")
    if not limits.declared:
        return Judgement(Outcome.PASS)
    if isinstance(value, bool | str):
        return Judgement(Outcome.FAIL, None, f"has number limits, but the reading is {value!r}")
    return _within(float(value), limits, unit)


def _within(value: float, limits: Limits, unit: str) -> Judgement:
    gaps = [value - limits.min] if limits.min is not None else []
    gaps += [limits.max - value] if limits.max is not None else []
    margin = min(gaps) if gaps else None
    if margin is not None and margin < 0:
        return Judgement(Outcome.FAIL, margin, f"must be {limits.text(unit)}")
    low, high = limits.marginal_min, limits.marginal_max
    if (low is not None and value < low) or (high is not None and value > high):
        word = f"better {'at least' if low is not None and value < low else 'at most'}"
        bound = low if low is not None and value < low else high
        return Judgement(Outcome.MARGINAL, margin, f"{word} {bound:g}{f' {unit}' if unit else ''}")
    return Judgement(Outcome.PASS, margin)


def _same(value: Any, wanted: Any) -> bool:
    if isinstance(value, bool) or isinstance(wanted, bool) or isinstance(value, str) or isinstance(wanted, str):
        return type(value) is type(wanted) and value == wanted
    return math.isclose(value, wanted, rel_tol=1e-6, abs_tol=1e-9)
