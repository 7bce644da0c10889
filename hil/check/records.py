"""The record of a checklist: written whole and in one piece after every change, so that nothing done is ever lost."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hil.check.judge import Outcome, Value

FORMAT = 1
GO, NO_GO, ABORTED, INCOMPLETE = 0, 1, 3, 4  # exit codes of `perch-hil check`; 2 is usage, as everywhere
VERDICTS = {GO: "go", NO_GO: "no-go", INCOMPLETE: "incomplete"}


class RecordError(ValueError):
    """A record that cannot be read, written or used; the message says which file and why."""


@dataclass
class Entry:
    """One item's place in the record. Times are UTC, ISO 8601; `seconds` is how long the check took."""

    key: str
    group: str
    title: str
    kind: str  # automatic or manual
    must: bool
    optional: bool
    limit: str
    limits: dict[str, Value | None]
    unit: str
    help: str = ""  # what to do if it does not pass
    outcome: Outcome = Outcome.PENDING
    value: Value | None = None
    margin: float | None = None
    reason: str = ""
    detail: str = ""
    source: str = ""
    operator: str = ""
    utc: str = ""
    seconds: float | None = None
    history: list[str] = field(default_factory=list)  # what it was before it was tried again

    def reset(self) -> None:
        """Back to PENDING; what it was is kept in `history`."""
        if self.outcome is not Outcome.PENDING:
            who = f" by {self.operator}" if self.operator else ""
            said = "; ".join(part for part in (self.reason, self.detail) if part)
            self.history.append(f"{self.utc} {self.outcome}{who}{': ' + said if said else ''}")
        self.outcome, self.value, self.margin, self.seconds = Outcome.PENDING, None, None, None
        self.reason = self.detail = self.source = self.operator = self.utc = ""


@dataclass
class Record:
    """A whole record: what for (`subject`), the items, what happened on the way, and the sign-off."""

    subject: dict[str, Any]
    started_utc: str
    entries: list[Entry]
    sessions: list[dict[str, str]] = field(default_factory=list)
    sign_off: dict[str, str] | None = None

    @property
    def state(self) -> str:
        """`incomplete` until signed off."""
        return "signed" if self.sign_off else "incomplete"

    def exit_code(self) -> int:
        """NO_GO, INCOMPLETE or GO by the items alone; the sign-off is another matter."""
        outcomes = [entry.outcome for entry in self.entries]
        if Outcome.FAIL in outcomes:
            return NO_GO
        return GO if all(passed(entry) for entry in self.entries) else INCOMPLETE

    def content(self) -> dict[str, Any]:
        """What is signed."""
        code = self.exit_code()
        return {
            "format": FORMAT,
            "subject": self.subject,
            "started_utc": self.started_utc,
            "verdict": VERDICTS[code],
            "counts": {o.value: n for o in Outcome if (n := sum(e.outcome is o for e in self.entries))},
            "entries": [asdict(entry) for entry in self.entries],
            "sessions": self.sessions,
        }

    def as_dict(self) -> dict[str, Any]:
        """The file's content."""
        return {"state": self.state, **self.content(), "sign_off": self.sign_off}

    def sign(self, operator: str, utc: datetime) -> None:
        """Sign what is in it now. Raises RecordError without a name."""
        if not operator.strip():
            raise RecordError("a record is signed with a name")
        digest = _digest(self.content(), operator.strip(), iso(utc))
        self.sign_off = {"operator": operator.strip(), "utc": iso(utc), "sha256": digest}

    def genuine(self) -> bool:
        """True if signed, and nothing in it has changed since."""
        sign = self.sign_off
        return sign is not None and sign.get("sha256") == _digest(self.content(), sign["operator"], sign["utc"])


def passed(entry: Entry) -> bool:
    """True if the entry holds nothing up."""
    if entry.outcome in (Outcome.PASS, Outcome.MARGINAL, Outcome.SKIPPED):
        return True
    return entry.optional and entry.outcome is Outcome.UNKNOWN


def iso(moment: datetime) -> str:
    """UTC to the second, such as 2026-01-02T03:04:05Z."""
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def write(path: Path, record: Record) -> None:
    """Write in one piece and down to the disk: a crash, or an empty battery, leaves the old or the new one."""
    text = json.dumps(record.as_dict(), indent=2, allow_nan=False) + "\n"
    scratch = path.with_name(f".{path.name}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with scratch.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        scratch.replace(path)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as error:
        raise RecordError(f"{path}: the record cannot be written: {error.strerror}") from None


def read(path: Path) -> Record:
    """The record at `path`. Raises RecordError if it is none."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise RecordError(f"{path}: is no checklist record: {error}") from None
    try:
        if data["format"] != FORMAT:
            raise RecordError(f"{path}: is a record of format {data['format']}, this program reads {FORMAT}")
        entries = [Entry(**{**e, "outcome": Outcome(e["outcome"])}) for e in data["entries"]]
        sign = data["sign_off"]
        if sign is not None and not all(isinstance(sign.get(k), str) for k in ("operator", "utc", "sha256")):
            raise ValueError("its sign-off is damaged")
        return Record(data["subject"], data["started_utc"], entries, data["sessions"], sign)
    except RecordError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RecordError(f"{path}: is no checklist record, or a damaged one ({error!r})") from None


def find(folder: Path, wanted: Callable[[Record], bool]) -> list[tuple[Path, Record]]:
    """Readable records in `folder` that are `wanted`, newest first."""
    found = []
    for path in sorted(folder.glob("*.json"), reverse=True):
        try:
            record = read(path)
        except RecordError:
            continue
        if wanted(record):
            found.append((path, record))
    return sorted(found, key=lambda pair: pair[1].started_utc, reverse=True)


def _digest(content: dict[str, Any], operator: str, utc: str) -> str:
    text = json.dumps([content, operator, utc], sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
