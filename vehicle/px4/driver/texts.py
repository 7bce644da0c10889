"""STATUSTEXTs put together from their chunks."""

from __future__ import annotations

from collections import deque
from typing import Any

from vehicle.px4 import protocol as px4
from vehicle.px4.driver.types import Note

_LAST_CHUNK_NS = 500_000_000


class Texts:
    """Collects the autopilot's texts. PX4 marks texts that also go out as EVENT with a trailing TAB."""

    def __init__(self) -> None:
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
        return f"; the autopilot reports: {' / '.join(self.recent)}" if self.recent else ""

    def _finish(self) -> None:
        assert self._open is not None
        text, level = "".join(self._parts).strip(), self._open[1]
        self._parts.clear()
        self._open = None
        if not text:
            return
        severity = "error" if level <= px4.Severity.ERROR else "warning" if level == px4.Severity.WARNING else "info"
        self.notes.append(Note(severity, f"autopilot: {text}"))
        if severity != "info" and text not in self.recent:
            self.recent.append(text)
