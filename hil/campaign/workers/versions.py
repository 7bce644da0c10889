"""What a campaign's machines must agree on, so that a flight does not depend on the machine that flies it."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

from hil.recording.provenance import CODE, ProvenanceError, content_sha256, file_sha256, packages

_SAID = 3  # differences that a message names


def versions(root: Path) -> dict[str, str]:
    """Python, Ray, digest of the code under `root`, and the packages it depends on: name -> version.

    What cannot be told is a version that no other equals: the text says why.
    """
    try:
        found = packages() | {"code": code_digest(root)[:12]}
    except ProvenanceError as error:
        found = {"code": f"unknown ({error})"}
    return {"Python": platform.python_version(), "ray": metadata.version("ray"), **found}


def code_digest(root: Path) -> str:
    """Digest of every file of the project's packages under `root`: their code and their data."""
    return content_sha256({path.relative_to(root).as_posix(): file_sha256(path) for path in code_files(root)})


def code_files(root: Path) -> list[Path]:
    """The files of the project's packages, sorted; without those that Python or an editor leaves."""
    found = (path for package in CODE for path in (root / package).rglob("*") if path.is_file())
    unwanted = ("__pycache__", ".")
    return sorted(path for path in found if not any(part.startswith(unwanted) for part in path.relative_to(root).parts))


def difference(theirs: Mapping[str, str], ours: Mapping[str, str]) -> str:
    """In words, what of `theirs` differs from `ours`; empty if nothing does."""
    names = [name for name in ours if theirs.get(name) != ours[name]]
    said = [f"{name} {theirs.get(name, 'none')} and not {ours[name]}" for name in names[:_SAID]]
    more = [f"{len(names) - _SAID} more"] if len(names) > _SAID else []
    return ", ".join(said + more)
