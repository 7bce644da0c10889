"""Checks before a run that its folder has enough free space."""

from __future__ import annotations

import shutil
from pathlib import Path

from hil.recording.runs import RunError

# Free bytes by what is kept of the pictures: some fifty times a usual run with previews (7 MB), three times one of a
# minute with raw pictures (9 MB/s).
NEEDED = {"none": 200_000_000, "preview": 400_000_000, "all": 800_000_000, "raw": 1_600_000_000}


def check_space(folder: Path, pictures: str) -> None:
    """Raises RunError if too little is free where `folder` is, or will be made. `pictures`: as for a run."""
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    free, needed = shutil.disk_usage(there).free, NEEDED[pictures]
    if free < needed:
        raise RunError(
            f"{there}: {free / 1e6:.0f} MB are free and a run needs {needed / 1e6:.0f} MB: make room, or give --out"
        )
