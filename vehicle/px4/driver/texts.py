"""What the autopilot says: STATUSTEXTs put together from their chunks, and EVENTs in words."""

from __future__ import annotations

from collections import deque
from typing import Any

from vehicle.px4 import protocol as px4
from vehicle.px4.driver.types import Note
from vehicle.px4.event_texts import EventTexts

_LAST_CHUNK_NS = 500_000_000
_NEW_REPORT = "commander_arming_check_summary"  # begins a report of the checks before arming
_EXTERNAL = 0x0F  # bits of log_levels that are meant for others; above the severities are those meant for no reader


class Texts:
    """Collects the autopilot's texts. PX4 marks texts that also go out as EVENT with a trailing TAB: they are left out
    where EVENTs are read."""

    def __init__(self, events: EventTexts | None = None) -> None:
        """`events`: what the firmware's EVENTs say; None: they are not read."""
        self._events = events
        self._refusals: list[str] = []  # errors of the newest checks before arming
        self._parts: list[str] = []
        self._open: tuple[int, int, int] | None = None  # id, severity, next chunk
        self._since_ns = 0
        self.recent: deque[str] = deque(maxlen=3)  # for quotation: warnings and worse
        self.notes: list[Note] = []

    def receive(self, f: Any, now_ns: int) -> None:
        """One STATUSTEXT."""
        if self._open is not None and (f.id, f.severity, f.chunk_seq) != self._open:
            self._finish()
        if self._open is None and f.chunk_seq:
            return  # the beginning was lost
        self._parts.append(f.text)
        self._open, self._since_ns = (f.id, f.severity, f.chunk_seq + 1), now_ns
        if len(f.text) < px4.STATUSTEXT_CHUNK:
            self._finish()

    def event(self, f: Any, now_ns: int) -> None:
        """One EVENT."""
        said = self._events and self._events.read(f.id, bytes(f.arguments))
        if not said:
            return
        level = f.log_levels & _EXTERNAL
        if said.name == _NEW_REPORT:
            self._refusals.clear()
        elif said.group != "default":
            if level <= px4.Severity.ERROR and said.text not in self._refusals:
                self._refusals.append(said.text)
        elif level <= px4.Severity.INFO:
            self._say(said.text, level)

    def flush(self, now_ns: int) -> None:
        """A text whose last chunk happened to be full is complete when nothing follows."""
        if self._open is not None and now_ns - self._since_ns > _LAST_CHUNK_NS:
            self._finish()

    def take(self) -> list[Note]:
        """Complete texts since the last call."""
        notes, self.notes = self.notes, []
        return notes

    def quote(self) -> str:
        """The latest warnings, for a failure's text; empty if there were none."""
        said = (*self.recent, *self._refusals)
        return f"; the autopilot reports: {' / '.join(said)}" if said else ""

    def _finish(self) -> None:
        assert self._open is not None
        text, level = "".join(self._parts), self._open[1]
        self._parts.clear()
        self._open = None
        if text.strip() and not (self._events and text.endswith("\t")):
            self._say(text.strip(), level)

    def _say(self, text: str, level: int) -> None:
        severity = "error" if level <= px4.Severity.ERROR else "warning" if level == px4.Severity.WARNING else "info"
        self.notes.append(Note(severity, f"autopilot: {text}"))
        if severity != "info" and text not in self.recent:
            self.recent.append(text)
