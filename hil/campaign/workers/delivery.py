"""A task on a machine of a cluster: done in a scratch folder, and its runs brought back as bytes."""

from __future__ import annotations

import json
import platform
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from hil.campaign.workers.shipment import Shipment
from hil.campaign.workers.versions import difference, versions
from hil.campaign.workers.work import Place
from hil.recording.provenance import ROOT
from hil.recording.runs import MANIFEST, Run, RunError, claim_folder, list_runs

Files = Mapping[str, bytes]
"""A run's folder: path in it -> content."""


@dataclass(frozen=True)
class Delivery:
    """The answer to one task with the runs that it left: name -> files. `refused`: why the machine does not fit."""

    answer: Any = None
    runs: Mapping[str, Files] | None = None
    refused: str = ""

    def keep(self, out: Path) -> None:
        """Put the runs into the campaign's folder, each whole or not at all. Raises RunError."""
        for name, files in (self.runs or {}).items():
            keep_run(out, name, files)


def unfit(wanted: Mapping[str, str]) -> str:
    """Why this machine does not fit one of versions `wanted`; empty if it does."""
    wrong = difference(_versions(), wanted)
    return f"{platform.node()} has {wrong}" if wrong else ""


def deliver(shipment: Shipment, task: Any) -> Delivery:
    """Do the task on this machine, which imports the code that was shipped."""
    refused = unfit(shipment.versions)
    if refused:
        return Delivery(refused=refused)
    files = shipment.unpack(ROOT / "shipped")
    with tempfile.TemporaryDirectory(prefix="runs-", dir=ROOT) as scratch:  # deleted with the code if this is killed
        answer = shipment.work(task, Place(Path(scratch), files))
        names = {path: name for name, path in files.items()}
        return Delivery(answer, {run.path.name: _packed(run.path, names) for run in list_runs(Path(scratch))})


def keep_run(root: Path, base: str, files: Mapping[str, bytes]) -> Run:
    """Put a run that was made elsewhere into `root`: path in its folder -> content, a manifest among them.

    It is there whole or not at all, and called `base` or the next free name. Raises RunError.
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".new-", dir=root, ignore_cleanup_errors=True) as made:
            scratch = Path(made) / "run"
            for name, content in files.items():
                (scratch / name).parent.mkdir(parents=True, exist_ok=True)
                (scratch / name).write_bytes(content)
            return claim_folder(scratch, root, base, json.loads(files[MANIFEST]))
    except OSError as error:
        raise RunError(f"{root}: a run cannot be kept there: {error.strerror}") from None


@lru_cache(maxsize=1)
def _versions() -> dict[str, str]:
    return versions(ROOT)


def _packed(folder: Path, names: Mapping[str, str]) -> dict[str, bytes]:
    """The run's files; its manifest calls files as they are called where the campaign was started."""
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    manifest = _renamed(json.loads(files[MANIFEST]), names)
    return {**files, MANIFEST: json.dumps(manifest).encode()}


def _renamed(value: Any, names: Mapping[str, str]) -> Any:
    if isinstance(value, dict):
        return {key: _renamed(inner, names) for key, inner in value.items()}
    if isinstance(value, list):
        return [_renamed(inner, names) for inner in value]
    return names.get(value, value) if isinstance(value, str) else value
