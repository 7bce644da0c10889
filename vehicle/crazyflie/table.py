"""Tables of contents: the names, types and numbers of the Crazyflie's log variables and parameters."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from vehicle.crazyflie.crtp import MOST_DATA, Table

# Kind of a variable: its number in a table, and how struct packs it.
LOG_KINDS: Mapping[str, tuple[int, str]] = {
    "uint8": (1, "<B"), "uint16": (2, "<H"), "uint32": (3, "<I"), "int8": (4, "<b"), "int16": (5, "<h"),
    "int32": (6, "<i"), "float": (7, "<f"), "half": (8, "<e"),
}  # fmt: skip
PARAMETER_KINDS: Mapping[str, tuple[int, str]] = {
    "uint8": (8, "<B"), "uint16": (9, "<H"), "uint32": (10, "<I"), "int8": (0, "<b"), "int16": (1, "<h"),
    "int32": (2, "<i"), "float": (6, "<f"),
}  # fmt: skip
READ_ONLY = 0x40
_NAMES = MOST_DATA - 4 - 2  # bytes that group and name may have together

_HEAD = struct.Struct("<BHB")
_LOG_INFO, _PARAMETER_INFO = struct.Struct("<BHIBB"), struct.Struct("<BHI")


class Variable(NamedTuple):
    """One entry of a table."""

    group: str
    name: str
    kind: str
    read_only: bool = False

    @property
    def full(self) -> str:
        return f"{self.group}.{self.name}"


class TableError(ValueError):
    """A table of contents that cannot be used."""


class Contents:
    """A table: variables by number and by name."""

    def __init__(self, variables: Iterable[Variable], kinds: Mapping[str, tuple[int, str]]) -> None:
        """Raises TableError for a name that is given twice, or too long for one packet."""
        self.variables = tuple(variables)
        self.kinds = kinds
        self.numbers = {variable.full: number for number, variable in enumerate(self.variables)}
        if len(self.numbers) != len(self.variables):
            raise TableError("a table of contents names one of its variables twice")
        for variable in self.variables:
            if len(variable.group) + len(variable.name) > _NAMES:
                raise TableError(f"{variable.full} is too long for one packet: {_NAMES} bytes at most")
        self.items = tuple(self._item(number) for number in range(len(self.variables)))
        self.crc = 0
        for item in self.items:
            self.crc = zlib.crc32(item, self.crc)

    def _item(self, number: int) -> bytes:
        variable = self.variables[number]
        kind = self.kinds[variable.kind][0] | (READ_ONLY if variable.read_only else 0)
        names = variable.group.encode("latin-1") + b"\0" + variable.name.encode("latin-1") + b"\0"
        return _HEAD.pack(Table.ITEM, number, kind) + names

    def answer(self, request: bytes, most: tuple[int, int] | None = None) -> bytes | None:
        """What a device answers on the table's channel; None for a request that is none.

        `most`: the log's limits, blocks and variables in all of them; None for parameters.
        """
        if request[:1] == bytes((Table.INFO,)):
            if most is None:
                return _PARAMETER_INFO.pack(Table.INFO, len(self.items), self.crc)
            return _LOG_INFO.pack(Table.INFO, len(self.items), self.crc, *most)
        if request[:1] == bytes((Table.ITEM,)) and len(request) >= 3:
            number = int.from_bytes(request[1:3], "little")
            return self.items[number] if number < len(self.items) else request[:1]
        return None


def read_info(data: bytes) -> tuple[int, int] | None:
    """(count, CRC) from a device's answer to Table.INFO; None if `data` is no such answer."""
    if len(data) < _PARAMETER_INFO.size or data[0] != Table.INFO:
        return None
    _, count, crc = _PARAMETER_INFO.unpack_from(data)
    return count, crc


def read_item(data: bytes, kinds: Mapping[str, tuple[int, str]]) -> tuple[int, Variable] | None:
    """(number, variable) from a device's answer to Table.ITEM; None if `data` is no such answer.

    Raises TableError for a type that the protocol does not have.
    """
    if len(data) < _HEAD.size + 2 or data[0] != Table.ITEM:
        return None
    _, number, kind = _HEAD.unpack_from(data)
    group, _, name = data[_HEAD.size :].partition(b"\0")
    by_number = {numbers[0]: text for text, numbers in kinds.items()}
    text = by_number.get(kind & 0x0F)
    full = Variable(group.decode("latin-1"), name.rstrip(b"\0").decode("latin-1"), text or "", bool(kind & READ_ONLY))
    if text is None:
        raise TableError(f"{full.full} has type {kind:#x}, which is not known")
    return number, full


def packed(value: float, form: str) -> bytes:
    """A number in the form of its kind: whole kinds are cut and wrap, as a cast in C does; out of range is infinite."""
    code = form[-1]
    if code in "ef":
        try:
            return struct.pack(form, value)
        except (OverflowError, struct.error):
            return struct.pack(form, math.copysign(math.inf, value))
    bits = 8 * struct.calcsize(form)
    whole = int(value) % (1 << bits) if math.isfinite(value) else 0
    if code.islower() and whole >= 1 << (bits - 1):
        whole -= 1 << bits
    return struct.pack(form, whole)
