"""Run folders: one folder per run, created with its manifest, never overwritten.

    runs/20260102T030405Z_hard-i_sim-seed7/
        manifest.json   what was run: code, packages, scenario, rig, seed, policy, machine; times of the wall clock
        run.mcap        the recording
        score.json      the verdict
        dirty.patch     uncommitted changes of the code, if there were any

Simulated and real runs never share an identity: the folder's name and the manifest state which it is.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hil.recording import provenance
from hil.recording.provenance import ProvenanceError
from policies.flying.shipped import SHIPPED, policy_data, policy_file

MANIFEST, RECORDING, SCORE, PATCH = "manifest.json", "run.mcap", "score.json", "dirty.patch"
FORMAT = 1


class RunError(RuntimeError):
    """A run folder cannot be made or read."""


@dataclass(frozen=True)
class Run:
    """One run's folder."""

    path: Path

    @property
    def recording(self) -> Path:
        return self.path / RECORDING

    @property
    def manifest(self) -> dict[str, Any]:
        return _read_json(self.path / MANIFEST)

    @property
    def score(self) -> dict[str, Any] | None:
        """The verdict, or None if the run did not get as far."""
        return _read_json(self.path / SCORE) if (self.path / SCORE).exists() else None

    def add(self, tables: Mapping[str, Any]) -> None:
        """Put more into the manifest. Raises RunError for a table that it has already."""
        manifest = self.manifest
        taken = [name for name in tables if name in manifest]
        if taken:
            raise RunError(f"{self.path / MANIFEST}: holds {', '.join(taken)} already")
        write_json(self.path / MANIFEST, {**manifest, **tables})

    def begin(self, zero_utc: datetime) -> None:
        """Write which wall time 0 ns of the run's clock was (in lockstep: when its virtual time began to run)."""
        manifest = self.manifest
        manifest["wall_clock"]["zero_utc"] = zero_utc.astimezone(UTC).isoformat(timespec="milliseconds")
        write_json(self.path / MANIFEST, manifest)

    def finish(
        self, state: str, ended_utc: datetime, files: Mapping[str, Mapping[str, Any]] | None = None, **wall_clock: float
    ) -> str:
        """Write `files` (name -> table), then how the run ended (`finished`, `interrupted`, `failed`), when, and what
        the wall clock measured.

        Returns what could not be written, as text; empty if everything was. Such a run has failed, and says so.
        """
        fault = ""
        for name, table in (files or {}).items():
            try:
                write_json(self.path / name, table)
            except OSError as error:
                fault = fault or f"{self.path / name} cannot be written: {error.strerror}"
        try:
            manifest = self.manifest
            manifest["state"] = "failed" if fault else state
            manifest["wall_clock"].update({"ended_utc": _iso(ended_utc), **wall_clock})
            write_json(self.path / MANIFEST, manifest)
        except OSError as error:
            fault = fault or f"{self.path / MANIFEST} cannot be written: {error.strerror}"
            self._mark_failed()
        return fault

    def _mark_failed(self) -> None:
        """Change the state in the manifest's own bytes, which takes no room on a full disk."""
        was, now = b'"state": "running"', b'"state": "failed" '
        with suppress(OSError), (self.path / MANIFEST).open("r+b") as file:
            at = file.read().find(was)
            if at >= 0:
                file.seek(at)
                file.write(now)


def new_run(
    root: Path,
    *,
    scenario: Mapping[str, Any],
    rig: Mapping[str, Any],
    seed: int,
    host: str,
    policy: Mapping[str, Any],
    simulated: bool,
    started_utc: datetime,
    more: Mapping[str, Any] | None = None,
    code: provenance.Code | None = None,
) -> Run:
    """Make the folder of a run under `root`, with its manifest in it.

    `scenario` and `rig` are the read files as plain tables (with `name` and `source`), `policy` names what flies (see
    `policy_identity`), `started_utc` is the wall clock's time, `more` adds tables to the manifest. `code` saves asking
    git again when many runs start together.
    Raises ProvenanceError (nothing is made then) if the run's origin is unknown, RunError if `root` is unusable.
    """
    code = code or provenance.code()
    identity = "sim" if simulated else "real"
    manifest = {
        "format": FORMAT,
        "identity": identity,
        "state": "running",
        "seed": seed,
        "host": host,
        "policy": dict(policy),
        "scenario": dict(scenario),
        "rig": dict(rig),
        "code": code.manifest(),
        "packages": provenance.packages(),
        "machine": provenance.machine(),
        **(more or {}),
        "wall_clock": {"started_utc": _iso(started_utc)},
    }
    if not manifest["scenario"].get("name") or not manifest["policy"].get("name"):
        raise ProvenanceError("the manifest of a run needs the names of its scenario and of its policy")
    base = f"{started_utc.astimezone(UTC):%Y%m%dT%H%M%SZ}_{manifest['scenario']['name']}_{identity}"
    base += f"-seed{seed}" if simulated else f"-{_next_number(root, manifest['scenario']['name']):03d}"
    try:
        root.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=".new-", dir=root))
    except OSError as error:
        raise RunError(f"cannot make a run folder in {root}: {error.strerror}") from None
    try:
        scratch.chmod(0o755)
        if code.patch:
            (scratch / PATCH).write_bytes(code.patch)
        return claim_folder(scratch, root, base, manifest)
    except OSError as error:
        raise RunError(f"cannot make a run folder in {root}: {error.strerror}") from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def claim_folder(scratch: Path, root: Path, base: str, manifest: dict[str, Any]) -> Run:
    """Move `scratch` to `root`, called `base` or base-2, base-3, ... and with that name in `manifest`, which is written
    into it. Raises RunError, OSError."""
    for attempt in range(1, 1000):
        name = base if attempt == 1 else f"{base}-{attempt}"
        manifest["wall_clock"]["run"] = name
        write_json(scratch / MANIFEST, manifest)
        try:
            (root / name).mkdir()  # claims the name: a rename alone would replace an empty folder
        except FileExistsError:
            continue
        scratch.rename(root / name)
        return Run(root / name)
    raise RunError(f"{root} holds a thousand runs called {base}")


def policy_identity(policy: str) -> dict[str, Any]:
    """The manifest's `policy` table: its name; a network's sha256; the path of one that the project does not ship; the
    sha256 of other data that it flies with.

    Raises ProvenanceError if it looks like a file and cannot be read.
    """
    file = policy_file(policy)
    if file is None:
        return {"name": policy} | {
            f"{part}_sha256": provenance.file_sha256(data) for part, data in policy_data(policy).items()
        }
    sha256 = provenance.file_sha256(file)
    if policy in SHIPPED:
        return {"name": policy, "sha256": sha256}
    return {"name": file.name, "path": str(file.resolve()), "sha256": sha256}


def open_run(path: Path | str) -> Run:
    """The run in folder `path`. Raises RunError if there is none or its manifest is unreadable."""
    run = Run(Path(path))
    if run.path.is_file():
        raise RunError(f"{run.path}: is a file: give the run's folder")
    if not run.path.is_dir():
        raise RunError(f"{run.path}: no such run folder")
    if not (run.path / MANIFEST).exists():
        raise RunError(f"{run.path}: is no run folder: it has no {MANIFEST}")
    _ = run.manifest
    return run


def list_runs(root: Path) -> list[Run]:
    """Every run under `root`, oldest first; folders without a manifest are no runs."""
    if not root.is_dir():
        return []
    return [Run(path) for path in sorted(root.iterdir()) if path.name[:1] != "." and (path / MANIFEST).exists()]


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Write `value` to `path` in one piece: a reader, a crash or a power cut never leaves half of it. NaN is refused.

    Raises OSError; what was at `path` is then still there.
    """
    text = json.dumps(value, indent=2, allow_nan=False) + "\n"
    scratch = path.with_name(f".{path.name}.new")
    try:
        with scratch.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        scratch.replace(path)
    except OSError:
        with suppress(OSError):
            scratch.unlink(missing_ok=True)
        raise


def _read_json(path: Path) -> dict[str, Any]:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise RunError(f"{path}: is damaged: {error}") from None


def _next_number(root: Path, scenario: str) -> int:
    """Real flights are distinguished by a counter: the seed of a real run means nothing."""
    names = (run.path.name.partition(f"_{scenario}_real-")[2][:3] for run in list_runs(root))
    return max((int(n) for n in names if n.isdecimal()), default=0) + 1


def _iso(moment: datetime) -> str:
    return moment.astimezone(UTC).isoformat(timespec="milliseconds")
