"""PX4's EVENT messages in words, by the description that comes with each build of the firmware (all_events.json.xz).

PX4 sends EVENTs on every link, STATUSTEXT only on links with a ground station. The format: MAVLink's events interface.
"""

from __future__ import annotations

import json
import lzma
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vehicle.px4.dialect import LETTERS

_FIELD = re.compile(r"\{(\d+)(:\.\d+)?([^}]*)\}")
_TAG = re.compile(r"</?\w[^>]*>")


@dataclass(frozen=True)
class EventText:
    """`group`: "default", or what the checks before arming report ("arming_check", "health"). `name`: the event's."""

    group: str
    name: str
    text: str


class EventTexts:
    """What each event says. An event that the description lacks, or describes wrongly, says nothing."""

    def __init__(self, description: Mapping[str, Any]) -> None:
        """`description`: all_events.json. Raises ValueError if it is none."""
        self._events: dict[int, tuple[str, Mapping[str, Any], str]] = {}  # id: group, event, namespace
        self._enums: dict[str, Mapping[str, Any]] = {}
        try:
            for number, component in description["components"].items():
                space = component["namespace"]
                self._enums |= {f"{space}::{name}": enum for name, enum in component.get("enums", {}).items()}
                for group, content in component["event_groups"].items():
                    for id, event in content["events"].items():
                        self._events[int(number) << 24 | int(id)] = group, event, space
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise ValueError(f"it does not describe events ({error!r})") from None

    def read(self, id: int, arguments: bytes) -> EventText | None:
        """The event `id` with its packed `arguments`."""
        if id not in self._events:
            return None
        group, event, space = self._events[id]
        try:
            values = self._values(event.get("arguments", ()), space, arguments)
            text = _FIELD.sub(lambda found: _shown(values[int(found[1]) - 1], found[2], found[3]), event["message"])
            return EventText(group, event["name"], _TAG.sub("", text))
        except (KeyError, IndexError, TypeError, ValueError, struct.error):
            return None

    def _values(self, described: Any, space: str, arguments: bytes) -> list[float | str]:
        values: list[float | str] = []
        at = 0
        for argument in described:
            kind = argument["type"]
            enum = self._enums[kind if "::" in kind else f"{space}::{kind}"] if kind not in LETTERS else None
            code = "<" + LETTERS[kind if enum is None else enum["type"]]
            (value,) = struct.unpack_from(code, arguments, at)
            at += struct.calcsize(code)
            entry = {} if enum is None else enum.get("entries", {}).get(str(value), {})
            values.append(entry.get("description", value))
        return values


def load_events(path: Path) -> EventTexts:
    """The description in the file `path`. Raises ValueError, or OSError, if it cannot be read."""
    try:
        with lzma.open(path) as file:
            return EventTexts(json.load(file))
    except (lzma.LZMAError, EOFError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} cannot be read ({error})") from None


def _shown(value: float | str, digits: str | None, unit: str) -> str:
    """A value as its place in the message asks for: "{2:.1m/s}", "{1}". A vertical metre is m_v there."""
    number = f"{value:{digits[1:]}f}" if digits and not isinstance(value, str) else f"{value}"
    return number + (f" {unit.removesuffix('_v')}" if unit else "")
