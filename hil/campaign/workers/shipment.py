"""What a cluster is given with a campaign: the code, the work, and the files that the work reads."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.campaign.workers.versions import code_files
from hil.campaign.workers.work import ClusterError, Work
from hil.recording.provenance import ROOT


@dataclass(frozen=True)
class ShippedFile:
    """One file: its own name, its sha256, and what it holds."""

    name: str
    sha256: str
    content: bytes


@dataclass(frozen=True)
class Shipment:
    """Everything that a task needs on another machine. `files` by the name that the work calls them by; `versions`:
    of the machine that sent it."""

    work: Work[Any, Any]
    files: Mapping[str, ShippedFile]
    versions: Mapping[str, str]

    @classmethod
    def of(cls, work: Work[Any, Any], versions: Mapping[str, str]) -> Shipment:
        """Reads the files. Raises ClusterError if one cannot be read."""
        files = {}
        for name, path in work.files.items():
            try:
                content = path.read_bytes()
            except OSError as error:
                raise ClusterError(f"{path}: cannot be read: {error.strerror}") from None
            files[name] = ShippedFile(path.name, hashlib.sha256(content).hexdigest(), content)
        return cls(work, files, versions)

    def unpack(self, folder: Path) -> dict[str, str]:
        """Put the files below `folder`, each in one named by its sha256; name -> path there. Several processes may do
        so at the same time. Raises ValueError for one that is not what was sent, OSError."""
        return {name: str(_put(folder, file)) for name, file in self.files.items()}


def _put(folder: Path, file: ShippedFile) -> Path:
    if hashlib.sha256(file.content).hexdigest() != file.sha256:
        raise ValueError(f"{file.name}: was damaged on the way: its sha256 differs")
    place = folder / file.sha256 / file.name
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=place.parent, delete=False) as scratch:
            scratch.write(file.content)
        Path(scratch.name).replace(place)  # whole or not at all
    return place


def copy_code(folder: Path) -> None:
    """Copy the project's packages into `folder`: what a machine of a cluster imports. Raises OSError."""
    for path in code_files(ROOT):
        place = folder / path.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, place)
