"""Messages of one topic as columns for plots, decoded on first access."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from hil.contract.codec import CodecError, codec
from hil.report.recorded.wire import doubles, integers, layouts

_BATCH = 8192  # messages whose bytes are arranged at once


class Messages(Sequence[Any]):
    """Messages as bytes, each decoded when it is asked for."""

    def __init__(self, kind: type, data: bytes | bytearray, offsets: np.ndarray) -> None:
        """Message i of the dataclass `kind` is `data[offsets[i]:offsets[i + 1]]`; `offsets` (n + 1,) int64."""
        self.kind, self.data, self.offsets = kind, data, offsets
        self._codec = codec(kind)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        i = range(len(self))[index]
        return self._codec.decode(bytes(self.data[self.offsets[i] : self.offsets[i + 1]]))

    def __iter__(self) -> Iterator[Any]:
        edges, decode = self.offsets.tolist(), self._codec.decode
        return (decode(bytes(self.data[a:b])) for a, b in pairwise(edges))

    def faults(self) -> dict[int, str]:
        """index -> why, of the messages that cannot be decoded."""
        bad: dict[int, str] = {}
        names = [f.name for f in dataclasses.fields(self.kind)]
        hints = typing.get_type_hints(self.kind)
        texts = [number for number, name in enumerate(names, 1) if hints[name] is str]
        for first in range(0, len(self), _BATCH):
            try:
                for where, rows, spans in layouts(self.data, self.offsets[first : first + _BATCH + 1]):
                    kinds = [rows[:, spans[n].start : spans[n].end] for n in texts if n in spans]
                    joined = [text.tobytes() for text in np.concatenate(kinds, axis=1)] if kinds else [b""] * len(rows)
                    one_each = {text: i for i, text in enumerate(joined)}  # equal layout and texts: one fault for all
                    wrong = {text: why for text, i in one_each.items() if (why := self._fault(first + int(where[i])))}
                    bad.update({first + int(where[i]): wrong[text] for i, text in enumerate(joined) if text in wrong})
            except ValueError:
                each = range(first, min(first + _BATCH, len(self)))
                bad.update({i: why for i in each if (why := self._fault(i))})
        return bad

    def _fault(self, index: int) -> str:
        try:
            self[index]
        except CodecError as error:
            return str(error)
        return ""


class Columns:
    """The messages of one topic in the order of publication; `columns["rho"]` is that field of all of them.

    Numbers and tuples of equal length become float64 arrays, (n,) or (n, k); anything else an object array.
    `published_ns` is the publication of every message in the recording, `log_ns` of those that are kept here.
    """

    def __init__(self, log_ns: np.ndarray, messages: Messages, published_ns: np.ndarray | None = None) -> None:
        self.log_ns, self.messages = log_ns, messages
        self.published_ns = log_ns if published_ns is None else published_ns
        hints = typing.get_type_hints(messages.kind)
        self._fields = {f.name: (i, hints[f.name]) for i, f in enumerate(dataclasses.fields(messages.kind), 1)}
        self._cache: dict[str, np.ndarray] = {}

    def __len__(self) -> int:
        return len(self.messages)

    def __getitem__(self, field: str) -> np.ndarray:
        if field not in self._cache:
            array = self._read(field)
            whole = array is not None and array.dtype == np.int64
            self._cache[field] = (
                array.astype(np.float64) if array is not None and whole else self._objects(field, array)
            )
        return self._cache[field]

    def nanoseconds(self, field: str = "stamp_ns") -> np.ndarray:
        """A field of times, int64."""
        array = self._read(field)
        return np.array([getattr(m, field) for m in self.messages], dtype=np.int64) if array is None else array

    def _texts(self, number: int) -> np.ndarray | None:
        """A field of texts, (n,) objects."""
        out = np.full(len(self), "", dtype=object)
        for first in range(0, len(self), _BATCH):
            try:
                groups = layouts(self.messages.data, self.messages.offsets[first : first + _BATCH + 1])
            except ValueError:
                return None
            for where, rows, spans in groups:
                if number in spans and spans[number].end > spans[number].start:
                    raw = np.ascontiguousarray(rows[:, spans[number].start : spans[number].end])
                    kept, of = np.unique(raw.view(f"S{raw.shape[1]}")[:, 0], return_inverse=True)
                    texts = np.array([text.decode() for text in kept.tolist()], dtype=object)
                    out[first + where] = texts[of]
        return out

    def _objects(self, field: str, array: np.ndarray | None) -> np.ndarray:
        return _array([getattr(message, field) for message in self.messages]) if array is None else array

    def _read(self, field: str) -> np.ndarray | None:
        """`field` without decoding the messages: int64, float64 or objects; None if that is not possible."""
        number, hint = self._fields[field]
        if hint is str:
            return self._texts(number)
        whole, kinds = hint in (int, bool), typing.get_args(hint)
        if not whole and hint is not float and (not kinds or kinds[0] is not float):
            return None
        width = 1 if whole or hint is float else None if Ellipsis in kinds else len(kinds)
        out: np.ndarray | None = None
        offsets, n = self.messages.offsets, len(self)
        for first in range(0, n, _BATCH):
            try:
                groups = layouts(self.messages.data, offsets[first : first + _BATCH + 1])
            except ValueError:
                return None
            for where, rows, spans in groups:
                span = spans.get(number)
                found = None if span is None else integers(rows, span)[:, None] if whole else doubles(rows, span)
                if width is None:  # a tuple of any length: a column only if all are equally long
                    width = 0 if found is None else found.shape[1]
                if (0 if found is None else found.shape[1]) not in ((width,) if Ellipsis in kinds else (0, width)):
                    return None
                if out is None:
                    out = np.zeros((n, width), dtype=np.int64 if whole else np.float64)
                if found is not None:
                    out[first + where] = found
        if out is None or width == 0:
            return None
        return out if kinds else out[:, 0]


def _array(values: list[Any]) -> np.ndarray:
    first = values[0] if values else 0.0
    if isinstance(first, bool | int | float):
        return np.array(values, dtype=np.float64)
    if isinstance(first, tuple) and first and len({len(value) for value in values}) == 1:
        return np.array(values, dtype=np.float64)
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array
