"""One service's process: starts it, monitors it, ends it and states the cause of its end.

The process does not outlive its parent.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

_PR_SET_PDEATHSIG = 1
_GRACE_S, _SLICE_S = 2.0, 0.1
PARENT = (
    "PERCH_SUPERVISOR"  # environment: the supervisor's process id, which may have ended before the service can check
)
_ENVIRONMENT = {
    # one thread a process: they are many; freed picture buffers stay with the process instead of being mapped anew
    **dict.fromkeys(
        ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"),
        "1",
    ),
    **dict.fromkeys(("MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_", "MALLOC_TOP_PAD_"), "67108864"),
}


def die_with_parent(parent: int) -> bool:
    """Receive SIGTERM when the parent process, with id `parent`, ends for any reason.

    False: it has ended already.
    """
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    return os.getppid() == parent


class Process:
    """One service's process; its output goes to `log`."""

    def __init__(self, name: str, command: list[str], log: Path) -> None:
        self.name, self.log = name, log
        with log.open("wb") as file:
            self._popen = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
                env={**os.environ, **_ENVIRONMENT, PARENT: str(os.getpid())}, start_new_session=True,
            )  # fmt: skip
        self.pid = self._popen.pid

    def ended(self) -> int | None:
        """Exit code (negative: the signal), or None while it runs."""
        return self._popen.poll()

    def stopped(self) -> bool:
        """Whether it is stopped (SIGSTOP): it exists but does not run."""
        return self._stat()[0] in ("T", "t")

    def leaving(self) -> int | None:
        """As `ended`, but known as soon as its main thread has ended.

        A process has not ended before its last thread has, and under real-time load that one waits for a core for
        seconds.
        """
        code = self.ended()
        if code is not None:
            return code
        state, status = self._stat()
        return os.waitstatus_to_exitcode(status) if state in ("Z", "X") else None

    def _stat(self) -> tuple[str, int]:
        """State character and wait status of its main thread (proc(5), /proc/pid/stat, fields 3 and 52)."""
        try:
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            return fields[0], int(fields[-1])
        except (OSError, IndexError):
            return "", 0

    def last_line(self) -> str:
        """The last line it wrote."""
        try:
            lines = self.log.read_text(errors="replace").strip().splitlines()
        except OSError:
            lines = []
        return lines[-1].removeprefix("perch-hil: ") if lines else ""

    def why(self) -> str:
        """How it ended, in words."""
        code = self.leaving()
        if code is None:
            return f"{self.name} runs"
        how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
        words = self.last_line()
        return f"{self.name} {how}" + (f": {words}" if words else "")

    def end(self, patience_s: float, meanwhile: Callable[[], object] = lambda: None, grace_s: float = _GRACE_S) -> str:
        """Wait `patience_s`, then SIGTERM, `grace_s` later SIGKILL. Returns what it took beyond patience.

        `meanwhile` is called several times a second while waiting.
        """
        if self._wait(patience_s, meanwhile):
            return ""
        for number in (signal.SIGTERM, signal.SIGKILL):
            self._popen.send_signal(number)
            if self._wait(grace_s, meanwhile):
                return f"{self.name} had to be stopped with {number.name}"
        return f"{self.name} cannot be stopped"

    def _wait(self, limit_s: float, meanwhile: Callable[[], object]) -> bool:
        until = time.monotonic() + limit_s
        while True:
            try:
                self._popen.wait(max(0.0, min(_SLICE_S, until - time.monotonic())))
                return True
            except subprocess.TimeoutExpired:
                meanwhile()
                if time.monotonic() >= until:
                    return False
