"""Finds and removes shared memory that killed processes have left behind."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

_FOLDER = Path("/dev/shm")
_NAME = re.compile(r"[^/\s]+\.zenoh")
_MAPPED = re.compile(r" /dev/shm/(\S+\.zenoh)$", re.MULTILINE)


def mapped_memory(process: int | str = "self") -> set[str]:
    """Names of the bus's shared-memory files that `process` (its id) holds; none if it has ended."""
    try:
        return set(_MAPPED.findall(Path(f"/proc/{process}/maps").read_text()))
    except OSError:
        return set()


def remove_orphaned_memory(names: Iterable[str]) -> list[str]:
    """Those of `names` that are still there although no other process holds them: removed, and returned.

    This process, which followed the run, may still hold what it received from one that was killed: the bus's library
    lets go of it late, and then leaves the file. Anything that is not a name of the bus's shared memory, such as a
    path, is ignored: `names` may come from the bus.
    """
    left = {name for name in names if _NAME.fullmatch(name) and (_FOLDER / name).exists()}
    if not left:
        return []
    for process in Path("/proc").glob("[0-9]*"):
        if process.name != str(os.getpid()):
            left -= mapped_memory(process.name)
    for name in left:
        (_FOLDER / name).unlink(missing_ok=True)
    return sorted(left)
