"""A message's values as protobuf bytes, by a few `struct` calls prepared once: quicker than protobuf's own class.

The bytes are those that protobuf writes: fields in the order of their numbers, repeated numbers packed, and what is
zero or empty left out.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import chain, groupby
from typing import Any, NamedTuple

Values = Sequence[Any]
Writer = Callable[[Values], bytes]
_VARINT, _FIXED64, _BYTES = 0, 1, 2  # protobuf's wire types
_INT64 = 1 << 63
# What a value of a wrong type, size or length raises; the caller finds out which it is.
WRONG = (struct.error, TypeError, ValueError, OverflowError)


class Field(NamedTuple):
    """One field: its number, the type of its numbers or texts, and how many: None for one, 0 for any number."""

    number: int
    kind: type
    count: int | None


@lru_cache(maxsize=4096)
def varint(number: int) -> bytes:
    """An int64 as protobuf writes it: seven bits a byte, the lowest first. Raises ValueError beyond 64 bits."""
    if 0x80 <= number < 0x4000:
        return bytes((number & 0x7F | 0x80, number >> 7))
    if not -_INT64 <= number < _INT64:
        raise ValueError(f"{number} does not fit into 64 bits")
    number &= 2 * _INT64 - 1
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes((*out, number))


def encoder(fields: Sequence[Field]) -> Writer | None:
    """What makes bytes of the values of `fields`, in their order; None for a kind of field that it does not know.

    It raises one of WRONG for a value that it cannot write.
    """
    writers: list[Writer] = []
    for make, run in groupby(enumerate(fields), key=lambda one: _MAKERS.get((one[1].kind, _many(one[1].count)))):
        if make is None:
            return None
        if make in (_scalars, _vectors):
            writers.append(make([*run]))
        else:
            writers += [make([one]) for one in run]
    if len(writers) == 1:
        return writers[0]
    return lambda values: b"".join([write(values) for write in writers])


def _many(count: int | None) -> str:
    return "one" if count is None else "fixed" if count else "any"


def _key(field: Field, wire_type: int) -> bytes:
    return varint(field.number << 3 | wire_type)


def _integer(run: Sequence[tuple[int, Field]]) -> Writer:
    at, key = run[0][0], _key(run[0][1], _VARINT)

    def write(values: Values) -> bytes:
        number = values[at]
        if type(number) is not int:
            raise TypeError(number)
        return key + varint(number) if number else b""

    return write


def _boolean(run: Sequence[tuple[int, Field]]) -> Writer:
    at, true = run[0][0], _key(run[0][1], _VARINT) + b"\1"

    def write(values: Values) -> bytes:
        if type(values[at]) is not bool:
            raise TypeError(values[at])
        return true if values[at] else b""

    return write


def _text(run: Sequence[tuple[int, Field]]) -> Writer:
    at, key = run[0][0], _key(run[0][1], _BYTES)

    def write(values: Values) -> bytes:
        if type(values[at]) is not str:
            raise TypeError(values[at])
        data = values[at].encode()
        return b"".join((key, varint(len(data)), data)) if data else b""

    return write


def _scalars(run: Sequence[tuple[int, Field]]) -> Writer:
    """Numbers, one each: in one piece where none is zero."""
    first, end = run[0][0], run[-1][0] + 1
    keys = [_key(field, _FIXED64) for _, field in run]
    whole = struct.Struct("<" + "".join(f"{len(key)}sd" for key in keys))
    each = struct.Struct("<d")

    def write(values: Values) -> bytes:
        part = values[first:end]
        if all(part):
            return whole.pack(*chain.from_iterable(zip(keys, part, strict=True)))
        return b"".join(
            [
                key + each.pack(value)
                for key, value in zip(keys, part, strict=True)
                if value or math.copysign(1.0, value) < 0.0  # protobuf leaves zero out, and keeps minus zero
            ]
        )

    return write


def _vectors(run: Sequence[tuple[int, Field]]) -> Writer:
    """Tuples of a known number of numbers: in one piece."""
    places = [at for at, _ in run]
    heads = [_key(field, _BYTES) + varint(8 * (field.count or 0)) for _, field in run]
    shape = [f"{len(head)}s{field.count}d" for head, (_, field) in zip(heads, run, strict=True)]
    whole = struct.Struct("<" + "".join(shape))

    def write(values: Values) -> bytes:
        parts: list[Any] = []
        for head, at in zip(heads, places, strict=True):
            parts.append(head)
            parts += values[at]
        return whole.pack(*parts)

    return write


def _numbers(run: Sequence[tuple[int, Field]]) -> Writer:
    """A tuple of any number of numbers."""
    at, key = run[0][0], _key(run[0][1], _BYTES)

    def write(values: Values) -> bytes:
        numbers = values[at]
        if not numbers:
            return b""
        return b"".join((key, varint(8 * len(numbers)), struct.pack(f"<{len(numbers)}d", *numbers)))

    return write


def _integers(run: Sequence[tuple[int, Field]]) -> Writer:
    """A tuple of any number of whole numbers."""
    at, key = run[0][0], _key(run[0][1], _BYTES)

    def write(values: Values) -> bytes:
        if not values[at]:
            return b""
        if {*map(type, values[at])} != {int}:
            raise TypeError(values[at])
        data = b"".join(map(varint, values[at]))
        return b"".join((key, varint(len(data)), data))

    return write


_MAKERS: dict[tuple[type, str], Callable[[Sequence[tuple[int, Field]]], Writer]] = {
    (int, "one"): _integer,
    (bool, "one"): _boolean,
    (str, "one"): _text,
    (float, "one"): _scalars,
    (float, "fixed"): _vectors,
    (float, "any"): _numbers,
    (int, "any"): _integers,
}
