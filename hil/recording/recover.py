"""Repairs a run whose recording was cut off: readable messages go into a new, indexed file; the original is kept."""

from __future__ import annotations

import os
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from hil.recording.mcap_writer import McapWriter
from hil.recording.reader import ReadError, Recording
from hil.recording.recorder import PICTURES
from hil.recording.runs import MANIFEST, RECORDING, Run, RunError, open_run, write_json

_ORIGINAL = "run.truncated.mcap"


class RecoverError(RuntimeError):
    """Nothing was changed; the message states why."""


@dataclass(frozen=True)
class Recovery:
    """What was done. `original` None: the recording was whole, and nothing was done."""

    run: Path
    messages: int
    seconds: float  # of log time, first to last message
    faults: tuple[str, ...]  # what was damaged, then what is missing, in seconds and topics
    original: Path | None


class _Source(Recording):
    """A recording that also lists its channels, in the file's order."""

    def channels(self) -> list[tuple[str, str, bytes]]:
        """(topic, schema name, schema) of each channel whose schema is known."""
        known = [(c.topic, self._schemas.get(c.schema_id)) for c in self._channels.values()]
        return [(topic, schema.name, schema.data) for topic, schema in known if schema is not None]


def recover(path: Path, now: datetime) -> Recovery:
    """Repair the run folder at `path`; `now` is written into its manifest.

    Every readable message keeps its time and order; sequence numbers are counted anew. Raises RecoverError: no run, a
    foreign or unreadable file, or a run that a process still writes. The original is never deleted or changed.
    """
    try:
        run = open_run(path)
        source = _Source(run.recording)
    except (RunError, ReadError) as error:
        raise RecoverError(str(error)) from None
    writer = _writer_of(run.recording)
    if writer:
        raise RecoverError(f"{run.recording}: process {writer} has it open: wait for the run to end, or stop it")
    before = source.counts()
    lost = source.missing()
    if source.complete and not source.faults and not lost:
        return Recovery(run.path, sum(before.values()), 0.0, (), None)
    if not sum(before.values()):
        raise RecoverError(f"{run.recording}: not one message in it can be read: {'; '.join(source.faults[:2])}")
    original = _free(run.path / _ORIGINAL)
    scratch = run.path / f".{RECORDING}.new"
    scratch.unlink(missing_ok=True)
    try:
        seconds = _rewrite(source, scratch)
        after = Recording(scratch)
        if after.counts() != before or after.faults or not after.complete:
            raise RecoverError(f"{run.recording}: what was written does not read back as it was: nothing changed")
        run.recording.rename(original)
        scratch.rename(run.recording)
    except OSError as error:
        raise RecoverError(f"{run.path}: cannot be repaired: {error.strerror}") from None
    finally:
        scratch.unlink(missing_ok=True)
    faults = (*source.faults, *map(str, lost))
    _note(run, now, faults, sum(before.values()), original)
    return Recovery(run.path, sum(before.values()), seconds, faults, original)


def _rewrite(source: _Source, target: Path) -> float:
    writer = McapWriter(target)
    try:
        ids: dict[str, int] = {}
        for topic, name, schema in source.channels():
            if topic not in ids:
                ids[topic] = writer.channel(topic, name, schema, "pictures" if topic.endswith(PICTURES) else "small")
        for name, values in source.metadata.items():
            writer.metadata(name, values)
        first = last = None
        for raw in source.raw():
            if raw.topic in ids:
                writer.add(ids[raw.topic], raw.log_ns, raw.data)
                first = raw.log_ns if first is None else first
                last = raw.log_ns
    finally:
        writer.close()
    return 0.0 if first is None or last is None else (last - first) * 1e-9


def _note(run: Run, now: datetime, faults: tuple[str, ...], messages: int, original: Path) -> None:
    manifest = run.manifest
    if manifest.get("state") == "running":  # its process has ended and cannot correct the entry
        manifest["state"] = "interrupted"
    manifest["recovered"] = {
        "utc": now.astimezone(UTC).isoformat(timespec="seconds"),
        "messages": messages,
        "faults": list(faults),
        "original": original.name,
    }
    write_json(run.path / MANIFEST, manifest)


def _free(path: Path) -> Path:
    number, candidate = 1, path
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return candidate


def _writer_of(path: Path) -> int | None:
    """A process that has `path` open for writing, if the system permits the look-up."""
    wanted = path.stat()
    for folder in Path("/proc").glob("[0-9]*/fd"):
        try:
            for link in folder.iterdir():
                found = link.stat()
                if (found.st_dev, found.st_ino) == (wanted.st_dev, wanted.st_ino) and _writes(link):
                    return int(folder.parent.name)
        except OSError:
            continue  # another user's process, or one that has just ended
    return None


def _writes(link: Path) -> bool:
    for line in (link.parent.parent / "fdinfo" / link.name).read_text().splitlines():
        if line.startswith("flags:"):
            return bool(int(line.split()[1], 8) & (os.O_WRONLY | os.O_RDWR))
    return False
