"""The base of every table of a scenario file, and its numbers."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict

Number = Annotated[float, Strict(), Field(ge=-1e6, le=1e6)]
Positive = Annotated[Number, Field(ge=1e-6)]
NotNegative = Annotated[Number, Field(ge=0)]


def _ordered(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] > value[1]:
        raise ValueError(f"[low, high] must be in order, but it is [{value[0]}, {value[1]}]")
    return value


Range = Annotated[tuple[Number, Number], AfterValidator(_ordered)]


class Table(BaseModel):
    """A TOML table: unknown keys, NaN and infinity are refused, values cannot change after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
