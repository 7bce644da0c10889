"""The record of a checklist: rewritten atomically after every change, so that no finished item is lost."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NotRequired

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from pydantic import BaseModel, ValidationError
from typing_extensions import TypedDict

from hil.check.crew_key import fingerprint, sign_digest, verifies
from hil.check.judge import Outcome, Value
from hil.check.moment import Moment

FORMAT = 2
_LARGEST = 16 << 20  # bytes of a record
GO, NO_GO, ABORTED, INCOMPLETE = 0, 1, 3, 4  # exit codes of `perch-hil check`; 2 is usage, as everywhere
VERDICTS = {GO: "go", NO_GO: "no-go", INCOMPLETE: "incomplete"}


class RecordError(ValueError):
    """A record that cannot be read, written or used; the message states which file and why."""


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
    help: str = ""  # remedy if it does not pass
    outcome: Outcome = Outcome.PENDING
    value: Value | None = None
    margin: float | None = None
    reason: str = ""
    detail: str = ""
    source: str = ""
    operator: str = ""
    utc: str = ""
    seconds: float | None = None
    history: list[str] = field(default_factory=list)  # earlier results, before it was tried again

    @property
    def found(self) -> str:
        """The value with its unit, to be read: yes or no, or a number of four digits. Empty without a value."""
        if self.value is None:
            return ""
        if isinstance(self.value, bool):
            return "yes" if self.value else "no"
        tiny = isinstance(self.value, float) and abs(self.value) < 1e-6
        number = "0" if tiny else f"{self.value:.4g}" if isinstance(self.value, float) else str(self.value)
        return f"{number} {self.unit}".rstrip()

    def reset(self) -> None:
        """Back to PENDING; the earlier result is kept in `history`."""
        if self.outcome is not Outcome.PENDING:
            by = f" by {self.operator}" if self.operator else ""
            text = "; ".join(part for part in (self.reason, self.detail) if part)
            self.history.append(f"{self.utc} {self.outcome}{by}{': ' + text if text else ''}")
        self.outcome, self.value, self.margin, self.seconds = Outcome.PENDING, None, None, None
        self.reason = self.detail = self.source = self.operator = self.utc = ""


class SignOff(TypedDict):
    """Name of the signing operator, the moment (`Moment`; UTC as ISO 8601), and the digest of the signed content."""

    operator: str
    utc: str
    boot: str
    uptime_ns: int
    sha256: str
    key: NotRequired[str]  # fingerprint of the crew's key; without one the record is only sealed by its digest
    signature: NotRequired[str]


@dataclass
class Record:
    """A whole record: what it clears (`subject`), the items, the sessions, and the sign-off.

    `autopilot`: the real autopilot that was checked, and the parameters that it held (`Arming.table`); else empty.
    """

    subject: dict[str, Any]
    started_utc: str
    entries: list[Entry]
    sessions: list[dict[str, str]] = field(default_factory=list)
    autopilot: dict[str, Any] = field(default_factory=dict)
    sign_off: SignOff | None = None

    @property
    def state(self) -> str:
        """`incomplete` until signed off; then `signed` with a key of the crew, or `sealed` by a digest only."""
        if self.sign_off is None:
            return "incomplete"
        return "signed" if self.sign_off.get("signature") else "sealed"

    def exit_code(self) -> int:
        """NO_GO, INCOMPLETE or GO by the items alone, without the sign-off."""
        outcomes = [entry.outcome for entry in self.entries]
        if Outcome.FAIL in outcomes:
            return NO_GO
        return GO if all(passed(entry) for entry in self.entries) else INCOMPLETE

    def content(self) -> dict[str, Any]:
        """What the sign-off covers."""
        code = self.exit_code()
        return {
            "format": FORMAT,
            "subject": self.subject,
            "started_utc": self.started_utc,
            "verdict": VERDICTS[code],
            "counts": {o.value: n for o in Outcome if (n := sum(e.outcome is o for e in self.entries))},
            "entries": [asdict(entry) for entry in self.entries],
            "sessions": self.sessions,
            "autopilot": self.autopilot,
        }

    def as_dict(self) -> dict[str, Any]:
        """The file's content."""
        return {"state": self.state, **self.content(), "sign_off": self.sign_off}

    def sign(self, operator: str, moment: Moment, key: Ed25519PrivateKey | None = None) -> None:
        """Sign off what is in it now, with the crew's `key` if given. Raises RecordError without a name."""
        if not operator.strip():
            raise RecordError("signing needs an operator's name")
        sign = SignOff(
            operator=operator.strip(), utc=iso(moment.utc), boot=moment.boot, uptime_ns=moment.uptime_ns, sha256=""
        )
        sign["sha256"] = digest = _digest(self.content(), sign)
        self.sign_off = sign
        if key is not None:
            self.sign_off["key"] = fingerprint(key.public_key())
            self.sign_off["signature"] = sign_digest(key, digest)

    def genuine(self) -> bool:
        """True if signed off, and nothing in it has changed since: a digest, which needs no key."""
        sign = self.sign_off
        return sign is not None and sign["sha256"] == _digest(self.content(), sign)

    def signed_by(self, keys: Mapping[str, Ed25519PublicKey]) -> bool:
        """True if unchanged since it was signed with one of `keys` (by fingerprint)."""
        sign = self.sign_off
        key = keys.get(sign.get("key", "")) if sign is not None else None
        if sign is None or key is None or not self.genuine():
            return False
        return verifies(key, sign["sha256"], sign.get("signature", ""))


class _File(BaseModel):
    """The file's content, as far as it is read: the verdict and the counts follow from the entries."""

    subject: dict[str, Any]
    started_utc: str
    entries: list[Entry]
    sessions: list[dict[str, str]]
    autopilot: dict[str, Any]
    sign_off: SignOff | None


def passed(entry: Entry) -> bool:
    """True if the entry does not block a go."""
    if entry.outcome in (Outcome.PASS, Outcome.MARGINAL, Outcome.SKIPPED):
        return True
    return entry.optional and entry.outcome is Outcome.UNKNOWN


def iso(moment: datetime) -> str:
    """UTC to the second, such as 2026-01-02T03:04:05Z."""
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def write(path: Path, record: Record) -> None:
    """Write atomically, with fsync: a crash or power loss leaves either the old or the new record."""
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
    """The record at `path`. Raises RecordError if it is none: whatever lies there, no other exception leaves."""
    try:
        if not path.is_file():  # a pipe of that name would block
            raise RecordError(f"{path}: is not a file")
        if path.stat().st_size > _LARGEST:
            raise RecordError(f"{path}: is larger than {_LARGEST >> 20} MiB: not a checklist record")
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, RecordError):
            raise
        raise RecordError(f"{path}: is not a checklist record: {error}") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        form = data.get("format") if isinstance(data, dict) else None
        raise RecordError(f"{path}: is a record of format {form}, this program reads {FORMAT}")
    try:
        found = _File.model_validate(data)
        record = Record(
            found.subject, found.started_utc, found.entries, found.sessions, found.autopilot, found.sign_off
        )
        json.dumps(record.as_dict(), allow_nan=False)
    except (ValueError, RecursionError) as error:
        faults = error.errors(include_url=False) if isinstance(error, ValidationError) else []
        why = f"{'.'.join(map(str, faults[0]['loc']))}: {faults[0]['msg']}" if faults else str(error)
        raise RecordError(f"{path}: is not a checklist record, or is damaged ({why})") from None
    return record


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


def _digest(content: dict[str, Any], sign: SignOff) -> str:
    """Of the content and of who signed it when."""
    signed = [content, sign["operator"], sign["utc"], sign["boot"], sign["uptime_ns"]]
    text = json.dumps(signed, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
