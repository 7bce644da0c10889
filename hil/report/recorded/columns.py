"""Messages of one topic as columns for plots, read on first access."""

from __future__ import annotations

import dataclasses
import typing
from collections import namedtuple
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from hil.contract.codec import CodecError, codec
from hil.recording.blocks import gather, readonly
from hil.report.recorded import wire

_SCALARS = {int: wire.NUMBER, bool: wire.NUMBER, float: wire.DOUBLE, str: wire.TEXT, bytes: wire.BYTES}


class Messages(Sequence[Any]):
    """Messages as bytes, each decoded when it is asked for."""

    def __init__(self, kind: type, data: bytes | bytearray | np.ndarray, offsets: np.ndarray) -> None:
        """Message i of the dataclass `kind` is `data[offsets[i]:offsets[i + 1]]`; `offsets` (n + 1,) int64."""
        self.kind, self.data, self.offsets = kind, readonly(data), offsets
        self._codec = codec(kind)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        i = range(len(self))[index]
        return self._codec.decode(self.data[self.offsets[i] : self.offsets[i + 1]].tobytes())

    def __iter__(self) -> Iterator[Any]:
        edges, decode = self.offsets.tolist(), self._codec.decode
        return (decode(self.data[a:b].tobytes()) for a, b in pairwise(edges))

    def checked(self) -> tuple[Messages, dict[int, str]]:
        """The messages whose columns can be read, and (index -> why) those that cannot be decoded.

        A message that another protobuf library wrote in another way is written anew.
        """
        _, kinds, widths = _layout(self.kind)
        doubtful = np.flatnonzero(~wire.sound(self.data, self.offsets, kinds, widths))
        anew, bad = {}, {}
        for i in doubtful.tolist():
            try:
                anew[i] = self._codec.encode(self[i])
            except CodecError as error:
                bad[i] = str(error)
        if not len(doubtful):
            return self, bad
        edges = self.offsets.tolist()
        parts = [anew.get(i, self.data[a:b].tobytes()) for i, (a, b) in enumerate(pairwise(edges)) if i not in bad]
        offsets = np.cumsum([0, *map(len, parts)], dtype=np.int64)
        return Messages(self.kind, b"".join(parts), offsets), bad


class Columns:
    """The messages of one topic in the order of publication; `columns["rho"]` is that field of all of them.

    Numbers and tuples of equal length become float64 arrays, (n,) or (n, k); anything else an object array.
    `published_ns` is the publication of every message in the recording, `log_ns` of those that are kept here.
    """

    def __init__(self, log_ns: np.ndarray, messages: Messages, published_ns: np.ndarray | None = None) -> None:
        """`messages` are those that `Messages.checked` gives."""
        self.log_ns, self.messages = log_ns, messages
        self.published_ns = log_ns if published_ns is None else published_ns
        self._numbers, self._kinds, self._widths = _layout(messages.kind)
        self._cache: dict[str, np.ndarray] = {}

    def __len__(self) -> int:
        return len(self.messages)

    def __getitem__(self, field: str) -> np.ndarray:
        if field not in self._cache:
            self._cache[field] = self._read(field)
        return self._cache[field]

    def nanoseconds(self, field: str = "stamp_ns") -> np.ndarray:
        """A field of times, int64."""
        return wire.integers(self.messages.data, *self._places(field))

    def lengths(self, field: str) -> np.ndarray:
        """How many numbers a field of any number of them holds, (n,) int64."""
        start, end = self._places(field)
        if self._kinds[self._numbers[field]] == wire.DOUBLES:
            return (end - start) // 8
        return wire.counts(self.messages.data, start, end)

    def flat(self, field: str) -> np.ndarray:
        """The numbers of a field of doubles, of all messages one after the other, float64."""
        return gather(self.messages.data, *self._places(field)).view("<f8")

    def rows(self, *fields: str, chosen: np.ndarray | None = None) -> list[Any]:
        """The messages (only `chosen` ones) with only these `fields`, numbers and texts as decoding gives them."""
        columns = []
        for name in fields:
            whole = self._kinds[self._numbers[name]] == wire.NUMBER
            values = self.nanoseconds(name) if whole else self[name]
            columns.append((values if chosen is None else values[chosen]).tolist())
        return list(map(_row(fields), *columns))

    def forget(self) -> None:
        """Free the columns that were read; they can be read again."""
        self._cache.clear()

    def _places(self, field: str) -> tuple[np.ndarray, np.ndarray]:
        return wire.places(self.messages.data, self.messages.offsets, self._numbers[field])

    def _read(self, field: str) -> np.ndarray:
        number = self._numbers[field]
        kind, width = self._kinds[number], self._widths[number]
        if kind == wire.NUMBER:
            return self.nanoseconds(field).astype(np.float64)
        if kind == wire.TEXT:
            return self._texts(field)
        if kind in (wire.DOUBLE, wire.DOUBLES):
            lengths = self.lengths(field) if kind == wire.DOUBLES else None
            if lengths is None or width:
                return self._doubles(field, max(1, int(width)), flat=lengths is None)
            if len(lengths) and lengths[0] and (lengths == lengths[0]).all():
                return self._doubles(field, int(lengths[0]), flat=False)
        array = np.empty(len(self), dtype=object)
        array[:] = [getattr(message, field) for message in self.messages]
        return array

    def _doubles(self, field: str, width: int, *, flat: bool) -> np.ndarray:
        """A field of `width` numbers, zeros where it is absent: (n, width), `flat` (n,)."""
        start, end = self._places(field)
        out = np.zeros((len(start), width))
        out[end > start] = gather(self.messages.data, start, end).view("<f8").reshape(-1, width)
        return out[:, 0] if flat else out

    def _texts(self, field: str) -> np.ndarray:
        """A field of texts, (n,) objects: equal texts are one object."""
        start, end = self._places(field)
        out = np.full(len(start), "", dtype=object)
        lengths = end - start
        for length in np.unique(lengths[lengths > 0]).tolist():
            where = np.flatnonzero(lengths == length)
            raw = gather(self.messages.data, start[where], end[where]).view(f"S{length}")
            kept, of = np.unique(raw, return_inverse=True)
            out[where] = np.array([text.decode() for text in kept.tolist()], dtype=object)[of]
        return out


@cache
def _row(fields: tuple[str, ...]) -> Any:
    return namedtuple("Row", fields)


@cache
def _layout(kind: type) -> tuple[dict[str, int], np.ndarray, np.ndarray]:
    """field -> its number, and by number how it is written and how many doubles it holds (0: any number)."""
    hints = typing.get_type_hints(kind)
    names = [f.name for f in dataclasses.fields(kind)]
    kinds = np.full(len(names) + 1, wire.OTHER, dtype=np.int64)
    widths = np.zeros(len(names) + 1, dtype=np.int64)
    for number, name in enumerate(names, 1):
        elements = typing.get_args(hints[name])
        if not elements:
            kinds[number] = _SCALARS[hints[name]]
        elif elements[0] in (int, float):
            kinds[number] = wire.DOUBLES if elements[0] is float else wire.NUMBERS
            widths[number] = 0 if Ellipsis in elements or elements[0] is int else len(elements)
    return {name: number for number, name in enumerate(names, 1)}, kinds, widths
