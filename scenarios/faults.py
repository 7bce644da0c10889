"""Faults of a scenario as data: `[[fault]]` tables, each with a kind, when it begins, how long it lasts, parameters.

Which kinds and parameters there are is said by `hil/faults`; here only what every table has is read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from kernel.toml_errors import nearest

# What a condition may compare, and what it means.
QUANTITIES = {
    "time": "s since the attempt's start",
    "distance": "m, from the vehicle to the board's centre, by motion capture",
    "height": "m, of the vehicle, by motion capture",
    "speed": "m/s, of the vehicle, by motion capture",
    "detections": "poses of the board found since the attempt's start",
    "stage": "of the run: prepare, lead, attempt, ended",
    "phase": "of the vehicle's driver: connect, parameters, ..., hover, handed_over",
}
STAGES = ("prepare", "lead", "attempt", "ended")
_TEXTS = ("stage", "phase")
_TERM = re.compile(r"""^\s*(\w+)\s*(<=|>=|==|!=|<|>)\s*(-?\d+(?:\.\d*)?|"\w+"|'\w+')\s*$""")
_OPERATIONS = {
    "<": lambda a, b: a < b, "<=": lambda a, b: a <= b, ">": lambda a, b: a > b, ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b, "!=": lambda a, b: a != b,
}  # fmt: skip


@dataclass(frozen=True)
class Condition:
    """Comparisons that must all hold: (quantity, operator, value)."""

    text: str
    terms: tuple[tuple[str, str, float | str], ...]

    @classmethod
    def read(cls, at: float | str) -> Condition:
        """The condition written as `at`: seconds of the attempt, or comparisons joined by "and". Raises ValueError."""
        if not isinstance(at, str):
            return cls(f"{at:g} s of the attempt", (("time", ">=", float(at)),))
        return cls(at, tuple(_term(part, at) for part in at.split(" and ")))

    def holds(self, situation: Mapping[str, float | str | None]) -> bool:
        """Whether it is true of `situation` (quantity -> value); a quantity that is not known makes it false."""
        for name, operator, value in self.terms:
            known = situation.get(name)
            if known is None or not _OPERATIONS[operator](known, value):
                return False
        return True


def _term(part: str, whole: str) -> tuple[str, str, float | str]:
    found = _TERM.match(part)
    if found is None:
        raise ValueError(
            f'"{whole}" is no condition: write seconds, or comparisons such as distance < 2.0 and stage == "attempt"'
        )
    name, operator, value = found.groups()
    if name not in QUANTITIES:
        raise ValueError(f'unknown quantity "{name}"{nearest(name, tuple(QUANTITIES))} Known: {", ".join(QUANTITIES)}')
    quoted = value[0] in "\"'"
    if quoted != (name in _TEXTS) or (quoted and operator not in ("==", "!=")):
        raise ValueError(f'"{part.strip()}" compares {name}, {QUANTITIES[name]}, with {value}')
    if name == "stage" and value[1:-1] not in STAGES:
        raise ValueError(f"there is no stage {value}{nearest(value[1:-1], STAGES)} Allowed: {', '.join(STAGES)}")
    return name, operator, value[1:-1] if quoted else float(value)


class FaultTable(BaseModel):
    """One `[[fault]]` table. Its further keys are `for` (s that it lasts, to the end of the run without it) and the
    parameters of its kind.

    `at`: seconds of the attempt, or a condition on `QUANTITIES`. `name`: what a campaign calls it, by default its kind;
    tables of one name fly together there. `seed`: of its random numbers, besides the run's seed.
    """

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    kind: str
    name: str = ""
    at: float | str = 1.0
    seed: int = 0

    @model_validator(mode="after")
    def _readable(self) -> FaultTable:
        if isinstance(self.at, float | int) and self.at < 0:
            raise ValueError(f"at is {self.at}: seconds of the attempt are not negative")
        _ = self.condition
        lasts = (self.model_extra or {}).get("for", 1.0)
        if isinstance(lasts, bool) or not isinstance(lasts, float | int) or not 0 < lasts < float("inf"):
            raise ValueError(f"for is {lasts!r}: give the seconds that it lasts, more than 0, or leave it out")
        return self

    @property
    def title(self) -> str:
        """What a campaign and a verdict call it."""
        return self.name or self.kind

    @property
    def condition(self) -> Condition:
        """When it begins."""
        return Condition.read(self.at)

    @property
    def lasts_s(self) -> float | None:
        """s, None: to the end of the run."""
        return (self.model_extra or {}).get("for")

    @property
    def parameters(self) -> dict[str, Any]:
        """The keys that its kind defines."""
        return {key: value for key, value in (self.model_extra or {}).items() if key != "for"}


class FaultFile(BaseModel):
    """A file of faults for a campaign: each name is flown by itself on every scenario."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    fault: tuple[FaultTable, ...]

    @model_validator(mode="after")
    def _some(self) -> FaultFile:
        if not self.fault:
            raise ValueError("it has no [[fault]] table")
        return self

    @property
    def cases(self) -> dict[str, tuple[FaultTable, ...]]:
        """name -> the tables that are flown together, in the file's order."""
        titles = dict.fromkeys(table.title for table in self.fault)
        return {title: tuple(table for table in self.fault if table.title == title) for title in titles}
