"""Messages of one topic as columns: what plots are made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


class Columns:
    """The messages of one topic in the order of publication; `columns["rho"]` is that field of all of them.

    Numbers and tuples of equal length become float64 arrays, (n,) or (n, k); anything else an object array.
    """

    def __init__(self, log_ns: Sequence[int], messages: Sequence[Any]) -> None:
        self.log_ns = np.array(log_ns, dtype=np.int64)
        self.messages = messages
        self._cache: dict[str, np.ndarray] = {}

    def __len__(self) -> int:
        return len(self.messages)

    def __getitem__(self, field: str) -> np.ndarray:
        if field not in self._cache:
            self._cache[field] = _array([getattr(message, field) for message in self.messages])
        return self._cache[field]

    def nanoseconds(self, field: str = "stamp_ns") -> np.ndarray:
        """A field of times, int64."""
        return np.array([getattr(message, field) for message in self.messages], dtype=np.int64)


def _array(values: list[Any]) -> np.ndarray:
    first = values[0] if values else 0.0
    if isinstance(first, bool | int | float):
        return np.array(values, dtype=np.float64)
    if isinstance(first, tuple) and first and len({len(value) for value in values}) == 1:
        return np.array(values, dtype=np.float64)
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array
