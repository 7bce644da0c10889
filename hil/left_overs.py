"""What hard ends leave behind in shared memory, and its removal."""

from __future__ import annotations

import os
from pathlib import Path


def remove_orphaned_memory(since: float) -> list[str]:
    """Shared-memory files of the bus, made after `since` (Unix time), that no process holds any more: removed.

    Returns their names. Hard ends leave them behind.
    """
    folder, removed = Path("/dev/shm"), []
    mine = [p for p in folder.glob("*.zenoh") if _is_ours(p, since)]
    if not mine:
        return removed
    held: set[str] = set()
    for maps in Path("/proc").glob("[0-9]*/maps"):
        try:
            text = maps.read_text()
        except OSError:
            continue
        held.update(p.name for p in mine if str(p) in text)
    for path in mine:
        if path.name not in held:
            path.unlink(missing_ok=True)
            removed.append(path.name)
    return removed


def _is_ours(path: Path, since: float) -> bool:
    try:
        status = path.stat()
    except OSError:
        return False
    return status.st_uid == os.getuid() and status.st_mtime >= since
