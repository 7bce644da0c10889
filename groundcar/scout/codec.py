"""The Scout Mini's CAN protocol V2: frames to named values and back, as `scout_mini.dbc` defines (read by cantools).

A frame is any (can_id, data) pair, so that frames of every wire fit; those made here also have the attributes `can_id`
and `data`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import cantools
from cantools.database.can import Database, Message

DBC_PATH = Path(__file__).parent / "scout_mini.dbc"
LENGTH = 8
V1_STATE_ID = 0x151  # a car that sends this uses protocol V1
COMMANDS = ("MotionCommand", "LightCommand", "BrakeCommand", "ControlMode", "ClearErrors")
SHORT_COMMANDS = ("BrakeCommand", "ControlMode", "ClearErrors")  # the manual sends one byte, AgileX's own SDK eight


class Frame(NamedTuple):
    """A CAN 2.0 data frame."""

    can_id: int
    data: bytes


@cache
def database() -> Database:
    """The DBC as cantools sees it."""
    loaded = cantools.database.load_file(DBC_PATH)
    assert isinstance(loaded, Database)
    return loaded


def message(name: str) -> Message:
    """The message called `name`. Raises ValueError with the names there are."""
    try:
        return database().get_message_by_name(name)
    except KeyError:
        known = ", ".join(m.name for m in database().messages)
        raise ValueError(f'the Scout has no message "{name}"; known: {known}') from None


def can_id(name: str) -> int:
    """The identifier of the message called `name`. Raises ValueError."""
    return message(name).frame_id


def feedback_names() -> list[str]:
    """Messages that the car sends."""
    return [m.name for m in database().messages if m.name not in COMMANDS]


@cache
def _ranges(name: str) -> dict[str, tuple[float, float]]:
    """Range of each signal: the DBC's, or that of its bits."""
    ranges = {}
    for s in message(name).signals:
        low, high = (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.is_signed else (0, (1 << s.length) - 1)
        stated = s.minimum is not None and s.maximum is not None
        ranges[s.name] = (s.minimum, s.maximum) if stated else (low * s.scale, high * s.scale)
    return ranges


def encode(name: str, values: Mapping[str, float]) -> Frame:
    """The frame of message `name`; signals left out are 0, values beyond the DBC's range are clamped to it.

    Raises ValueError for a value that is not finite, an unknown message or an unknown signal.
    """
    found, ranges = message(name), _ranges(name)
    clamped: dict[str, float] = dict.fromkeys(ranges, 0)
    for signal, value in values.items():
        if signal not in ranges:
            raise ValueError(f'{name} has no signal "{signal}"; known: {", ".join(ranges)}')
        if not math.isfinite(value):
            raise ValueError(f"{name}.{signal} is {value}: only finite numbers can be sent to the car")
        low, high = ranges[signal]
        clamped[signal] = min(max(value, low), high)
    return Frame(found.frame_id, found.encode(clamped, strict=False))


class Decoder:
    """Frames to values for one end of the bus; a foreign frame is counted, never raised."""

    def __init__(self, names: Iterable[str]) -> None:
        """`names`: the messages this end receives. Raises ValueError for one that the DBC does not have."""
        self._by_id = {can_id(name): message(name) for name in names}
        self._short = frozenset(can_id(name) for name in SHORT_COMMANDS)
        self._last: dict[int, tuple[bytes, dict[str, float]]] = {}  # of each message: most repeat the one before
        self.unknown_ids = 0
        self.wrong_lengths = 0

    @property
    def rejected(self) -> int:
        """Frames refused so far."""
        return self.unknown_ids + self.wrong_lengths

    def decode(self, frame: tuple[int, bytes]) -> tuple[str, dict[str, float]] | None:
        """(message name, values by signal, SI), or None for a frame of unknown id or wrong length.

        The values are not to be changed: they are given again while a message repeats itself.
        """
        found = self._by_id.get(frame[0])
        if found is None:
            self.unknown_ids += 1
            return None
        data = bytes(frame[1])
        if len(data) == 1 and frame[0] in self._short:
            data = data.ljust(LENGTH, b"\0")
        if len(data) != LENGTH:
            self.wrong_lengths += 1
            return None
        last = self._last.get(frame[0])
        if last is not None and last[0] == data:
            return found.name, last[1]
        values: dict = dict(found.decode(data, decode_choices=False))  # type: ignore[call-overload]
        self._last[frame[0]] = data, values
        return found.name, values
