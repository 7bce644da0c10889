"""`perch-hil check` on a terminal of its own, in a forked process that can be typed to, killed and looked at."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import signal
import struct
import sys
import termios
import time
from pathlib import Path
from typing import IO, Any

from hil.check.command import CheckRequest, run_checklist


def check_request(folder: Path, list_file: Path, **more) -> CheckRequest:
    """The command line of most tests; the record is folder/record.json."""
    options = {
        "list_name": str(list_file),
        "rig": "sim",
        "policy": None,
        "scenario": "simple-i",
        "record": folder / "record.json",
        "folder": folder / "checks",
        "operator": "Ann",
        "sign": False,
        "fresh": False,
        "run": None,
        "out": folder,
        "as_json": False,
        "junit_file": None,
    }
    return CheckRequest(**{**options, **more})


class Console:
    """A child that runs the command on a pseudo terminal of the given size."""

    def __init__(self, asked: CheckRequest, columns: int = 80, term: str = "xterm", **environment: str) -> None:
        self.text = ""
        self.pid, self._fd = pty.fork()
        if self.pid == 0:
            code = 99
            try:
                os.environ.update(TERM=term, **environment)
                os.environ.pop("COLUMNS", None)
                fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("4H", 30, columns, 0, 0))
                signal.signal(signal.SIGINT, signal.default_int_handler)
                sys.stdin, sys.stdout, sys.stderr = _open(0, "r"), _open(1, "w"), _open(2, "w")
                code = run_checklist(asked)
                sys.stdout.flush()
            finally:
                os._exit(code)

    def type(self, text: str) -> None:
        """As if typed."""
        os.write(self._fd, text.encode())

    def wait_for(self, words: str, seconds: float = 30.0) -> str:
        """Text from here to `words`; fails after `seconds`."""
        end = time.monotonic() + seconds
        while words not in self.text:
            ready, _, _ = select.select([self._fd], [], [], max(0.0, end - time.monotonic()))
            assert ready, f"waited for {words!r}, got:\n{self.text}"
            try:
                data = os.read(self._fd, 65536)
            except OSError:
                data = b""
            assert data, f"it ended without {words!r}:\n{self.text}"
            self.text += data.decode("utf-8", "replace")
        before, _, self.text = self.text.partition(words)
        return before + words

    def kill(self) -> None:
        """kill -9."""
        os.kill(self.pid, signal.SIGKILL)
        assert os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1]) == -signal.SIGKILL
        os.close(self._fd)

    def hang_up(self) -> None:
        """The terminal's window is closed."""
        os.close(self._fd)
        os.waitpid(self.pid, 0)

    def end(self) -> tuple[int, str]:
        """Exit code, and the remaining output."""
        rest = self.text
        while True:
            try:
                data = os.read(self._fd, 65536)
            except OSError:
                break
            if not data:
                break
            rest += data.decode("utf-8", "replace")
        os.close(self._fd)
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1]), rest


def _open(fd: int, mode: str) -> IO[Any]:
    return os.fdopen(fd, mode, buffering=1 if mode == "w" else -1, closefd=False)
