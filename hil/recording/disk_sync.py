"""Brings what was written to a recording from the operating system's memory onto the disk, in a thread of its own."""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from pathlib import Path

SYNC_S = 1.0  # a power cut loses what came after the last one


class DiskSync:
    """Calls fdatasync for the file at `path` every `SYNC_S`; the thread that writes the file never waits for it.

    `fault` holds why it failed, as text: what was written since the last one may not be on the disk. Use as a context
    manager around the recording: leaving it does it a last time.
    """

    def __init__(self, path: Path, period_s: float = SYNC_S) -> None:
        """Raises OSError if there is no file."""
        self.fault, self.count = "", 0
        self._path, self._period_s = path, period_s
        self._fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)  # its own: the writer may close the file meanwhile
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="disk-sync", daemon=True)

    def _serve(self) -> None:
        _sync_folder(self._path.parent)  # the file's name is on the disk too
        while not self._ended.wait(self._period_s):
            self._sync()

    def _sync(self) -> None:
        try:
            os.fdatasync(self._fd)
            self.count += 1
        except OSError as error:
            self.fault = self.fault or f"{self._path} cannot be brought onto the disk: {error.strerror}"

    def __enter__(self) -> DiskSync:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(self._period_s)
        if not self._thread.is_alive():  # else the disk hangs: its call still uses the descriptor
            self._sync()
            os.close(self._fd)


def _sync_folder(folder: Path) -> None:
    with suppress(OSError):  # some file systems do not have it
        fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)
