"""Names for the entries of a parameter row, made from the fields of the dataclasses that fill it."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import fields
from typing import Any, TypeVar, cast

Params = TypeVar("Params")


def row_index(params: type[Params], after: Any = None) -> Params:
    """The place of each field of the dataclass `params` in a row, from 0 on or after the index `after`.

    Returns a named tuple of integers with the field names of `params`. As a global, Numba compiles it to constants. It
    is declared as `params` itself, so that a type checker knows the names.
    """
    names = [each.name for each in fields(cast(Any, params))]
    made = namedtuple(f"{params.__name__}Index", names, module=params.__module__)  # type: ignore[misc]
    first = row_length(after) if after is not None else 0
    return cast(Params, made(*range(first, first + len(names))))


def row_length(last: Any) -> int:
    """The length of a row whose last group has the index `last`."""
    return last[-1] + 1
