"""What a service says of itself, as the supervisor takes it: every value of its kind, whatever was sent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_KINDS: dict[str, type | tuple[type, ...]] = {
    "state": str, "why": str, "serves": str, "session": str, "host": str, "pid": int, "now_ns": int, "garbage": int,
    "late": int, "safe": bool, "outputs": list, "graph": list, "memory": list, "cpu_s": (int, float),
    "rss_kb": (int, float), "own_kb": (int, float),
}  # fmt: skip
_COUNTS = ("dropped", "lost", "strangers", "counters")  # name -> number
_TABLES = (*_COUNTS, "nodes", "clock")
_CLOCK = ("offset_ns", "error_ns", "date_ns", "moved_ns")
_LONGEST = 1000  # characters of a text
_MOST = 1 << 62  # of any number; a larger one is none


def clean_health(table: Mapping[str, Any]) -> dict[str, Any]:
    """The health `table` without entries of the wrong kind. "service" is the one whose key it came on."""
    found = {key: value for key, value in table.items() if key not in _TABLES and _is(value, _KINDS.get(key, str))}
    found = {key: _text(value) if isinstance(value, str) else value for key, value in found.items()}
    found["service"] = str(table.get("service"))
    found |= {key: _numbers(table[key]) for key in _COUNTS if isinstance(table.get(key), dict)}
    for key in ("outputs", "memory"):
        if key in found:
            found[key] = [name for name in found[key] if isinstance(name, str)]
    if isinstance(table.get("nodes"), dict):
        found["nodes"] = {name: _numbers(pace) for name, pace in table["nodes"].items() if isinstance(pace, dict)}
    if isinstance(table.get("serves"), dict):  # digests by name
        found["serves"] = {name: text for name, text in table["serves"].items() if isinstance(text, str)}
    if "graph" in found:
        found["graph"] = [row for row in found["graph"] if _is_declaration(row)]
    clock = table.get("clock")
    if isinstance(clock, dict):
        complete = {name: 0 for name in _CLOCK} | _numbers(clock)
        found["clock"] = {**complete, "shared": clock.get("shared") is True}
    return found


def _is(value: Any, kind: type | tuple[type, ...]) -> bool:
    if isinstance(value, bool) or kind is bool:
        return isinstance(value, bool) and kind is bool
    return isinstance(value, kind) and (not isinstance(value, int | float) or abs(value) < _MOST)


def _text(value: str) -> str:
    """A text that can be shown and published: JSON may hold halves of characters."""
    return value[:_LONGEST].encode(errors="replace").decode()


def _numbers(table: Mapping[str, Any]) -> dict[str, Any]:
    return {str(name): value for name, value in table.items() if _is(value, (int, float))}


def _is_declaration(row: Any) -> bool:
    """Name, inputs, outputs, wakes, period of a node (`hil/live/graph.py`)."""
    if not isinstance(row, list) or len(row) != 5 or not isinstance(row[0], str) or not _is(row[4], int):
        return False
    return all(isinstance(names, list) and all(isinstance(name, str) for name in names) for names in row[1:4])
