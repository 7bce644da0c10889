"""Reads a table of contents: its length and CRC, every item, and once more its length and CRC."""

from __future__ import annotations

from collections.abc import Mapping

from vehicle.crazyflie.crtp import Packet, Table
from vehicle.crazyflie.table import TableError, Variable, read_info, read_item

_WINDOW = 8  # items that are asked for at a time
_AGAIN_NS = 300_000_000


class TableReader:
    """`requests` says what to send; `done` once `numbers` is complete, `fault` says why it never will be."""

    def __init__(self, port: int, kinds: Mapping[str, tuple[int, str]]) -> None:
        self._port, self._kinds = port, kinds
        self._info: tuple[int, int] | None = None
        self._variables: dict[int, Variable] = {}
        self._asked: dict[int, int] = {}  # item, or -1 for the info: when it was asked for
        self.numbers: dict[str, tuple[int, Variable]] = {}
        self.done, self.fault = False, ""

    def requests(self, now_ns: int) -> list[Packet]:
        """What is to be asked (again) now."""
        if self.done or self.fault:
            return []
        count = -1 if self._info is None else self._info[0]
        missing = [number for number in range(count) if number not in self._variables][:_WINDOW]
        wanted = missing or [-1]
        due = [at for at in wanted if now_ns - self._asked.get(at, -_AGAIN_NS) >= _AGAIN_NS]
        self._asked.update(dict.fromkeys(due, now_ns))
        return [Packet(self._port, 0, bytes((Table.INFO,)) if at < 0 else _item(at)) for at in due]

    def receive(self, data: bytes) -> None:
        """A packet of the table's channel."""
        if self.done or self.fault:
            return
        info = read_info(data)
        if info is not None:
            self._told(info)
            return
        try:
            item = read_item(data, self._kinds)
        except TableError as error:
            self.fault = str(error)
            return
        if item is not None and self._info is not None and item[0] < self._info[0]:
            self._variables[item[0]] = item[1]
            if len(self._variables) == self._info[0]:
                self._asked.clear()

    def _told(self, info: tuple[int, int]) -> None:
        if self._info is None:
            self._info = info
            self._asked.clear()
        elif info != self._info:
            (count, crc), (new_count, new_crc) = self._info, info
            before, after = f"{count} and {crc:08x}", f"{new_count} and {new_crc:08x}"
            self.fault = f"its length and CRC changed from {before} to {after} while it was read"
        elif len(self._variables) == info[0]:
            self.numbers = {variable.full: (number, variable) for number, variable in self._variables.items()}
            self.done = len(self.numbers) == info[0]
            if not self.done:
                self.fault = "it names one of its variables twice"


def _item(number: int) -> bytes:
    return bytes((Table.ITEM,)) + number.to_bytes(2, "little")
