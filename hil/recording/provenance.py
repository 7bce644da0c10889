"""Code, packages and machine that made a run. An unknown origin is an error: such a run would be no evidence."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import subprocess
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

DISTRIBUTION = "perch-hil"
ROOT = Path(__file__).resolve().parents[2]
CODE = ("kernel", "hil", "vehicle", "groundcar", "policies", "scenarios")  # where an untracked file changes a run
_FILES = ("*.py", "*.json", "*.dbc", "scout_mini.toml", "paper.toml")
"""Of it, what every run reads; what a run names (networks, rigs, scenarios, airframes) has digests of its own."""


class ProvenanceError(RuntimeError):
    """The origin of the code cannot be determined; the message states how to correct it."""


@dataclass(frozen=True)
class Code:
    """Where the running code comes from. `patch` is the uncommitted difference, kept beside the manifest."""

    source: str  # git, or package
    version: str
    commit: str  # empty for a package
    patch: bytes = b""
    untracked: tuple[tuple[str, str], ...] = ()  # path, sha256 of files that git does not track

    @property
    def dirty(self) -> bool:
        return bool(self.patch or self.untracked)

    def manifest(self) -> dict[str, Any]:
        """The manifest's `code` table."""
        table: dict[str, Any] = {"source": self.source, "version": self.version, "commit": self.commit or None}
        if self.source == "package":
            table["note"] = "not run from a git checkout: the installed package's version is all that is known"
        table["dirty"] = self.dirty
        if self.dirty:
            table["diff_sha256"] = hashlib.sha256(self.patch).hexdigest()
            table["untracked"] = dict(self.untracked)
        return table


def code(root: Path = ROOT, distribution: str = DISTRIBUTION) -> Code:
    """The code under `root`. Raises ProvenanceError if git fails in a checkout, or no version is found."""
    try:
        version = metadata.version(distribution)
    except metadata.PackageNotFoundError:
        version = ""
    if (root / ".git").exists():
        commit = _git(root, "rev-parse", "HEAD").decode().strip()
        patch = _git(root, "diff", "--binary", "--no-ext-diff", "HEAD")
        names = _git(root, "ls-files", "--others", "--exclude-standard", "-z", "--", *CODE).decode(
            errors="surrogateescape"
        )
        untracked = tuple((name, file_sha256(root / name)) for name in sorted(filter(None, names.split("\0"))))
        return Code("git", version, commit, patch, untracked)
    if not version:
        raise ProvenanceError(
            f"the origin of this code cannot be told: {root} is no git checkout and no package {distribution!r} is "
            "installed. Run from a clone, or install it with `pip install .`"
        )
    return Code("package", version, _installed_commit(distribution))


def _installed_commit(distribution: str) -> str:
    """The commit of a package installed straight from a repository; empty for any other."""
    text = metadata.distribution(distribution).read_text("direct_url.json")
    return json.loads(text).get("vcs_info", {}).get("commit_id", "") if text else ""


def packages(distribution: str = DISTRIBUTION) -> dict[str, str]:
    """Versions of what the project depends on directly, and of their direct dependencies, by name.

    Raises ProvenanceError if the project itself is not installed.
    """
    found: dict[str, str] = {}
    waiting, depth = [distribution], 0
    while waiting and depth < 3:
        following: list[str] = []
        for name in waiting:
            try:
                package = metadata.distribution(name)
            except metadata.PackageNotFoundError:
                if name == distribution:
                    raise ProvenanceError(
                        f"package {distribution!r} is not installed, so its packages' versions are unknown. "
                        "Install it with `pip install -e .`"
                    ) from None
                continue
            if name not in found:
                found[name] = package.version
                requirements = [r for r in package.requires or () if "extra ==" not in r]
                names = (m[0] for r in requirements if (m := re.match(r"[A-Za-z0-9._-]+", r)))
                following += [re.sub(r"[-_.]+", "-", n).lower() for n in names]
        waiting, depth = following, depth + 1
    return dict(sorted(found.items()))


def machine() -> dict[str, Any]:
    """What the run was computed on."""
    model = ""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
    except OSError:
        model = platform.processor()
    return {
        "name": platform.node(),
        "system": platform.platform(),
        "cpu": model,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
    }


def code_digests(root: Path = ROOT) -> dict[str, str]:
    """Package -> digest of its code as it lies under `root`, whatever git knows of it.

    Raises ProvenanceError if a file cannot be read.
    """
    return {name: _folder_digest(root / name) for name in CODE}


def content_sha256(content: Any) -> str:
    """Hex digest of plain tables, lists, texts and numbers."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _folder_digest(folder: Path) -> str:
    files = sorted(path for pattern in _FILES for path in folder.rglob(pattern))
    content = {path.relative_to(folder).as_posix(): file_sha256(path) for path in files}
    return content_sha256(content)[:16]


def file_sha256(path: Path) -> str:
    """Hex digest of a file's bytes. Raises ProvenanceError if it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ProvenanceError(f"{path}: cannot be read for its checksum: {error.strerror}") from None


def _git(root: Path, *arguments: str) -> bytes:
    try:
        return subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, check=True).stdout
    except FileNotFoundError:
        raise ProvenanceError(
            f"{root} is a git checkout, but git is not installed: the commit cannot be told"
        ) from None
    except subprocess.CalledProcessError as error:
        why = error.stderr.decode(errors="replace").strip() or "it said nothing"
        raise ProvenanceError(f"git could not tell the origin of {root}: {why}") from None
