"""Lines in the log of a service's process."""

from __future__ import annotations

import os
from contextlib import suppress


def log_line(text: str) -> None:
    """Write one line to this process's standard output. Never raises: a full disk, or a terminal that was closed,
    keeps no service from its work.

    Not by `print`: what it could not write stays in its buffer, fails again at exit, and changes the exit code.
    """
    with suppress(OSError):
        os.write(1, f"{text}\n".encode(errors="replace"))
