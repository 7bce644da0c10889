"""A deterministic firmware: it has a core of its own, and its clock goes on only once it has come to rest.

PX4 runs many threads, of which the scheduler decides which one is next. They have real-time priorities (SCHED_FIFO,
where the user may give them), so that one core runs them in one order; and a process of priority idle on the same core
runs only while all of them wait: its answer says that the firmware has done all it can, before it hears more or its
clock moves. PX4's start script is no part of that: it is watched from outside.
"""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from hil.wires import WireError
from hil.wires.simulator import CONNECT_S, SimulatorServer

REST_S = 10.0  # waited at most; a step takes 0.1 ms
COMMAND_S = 0.03  # a command of the start script that lasts longer waits for the clock
_IDLE = """
import os, sys
os.sched_setaffinity(0, {int(sys.argv[1])})
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
except PermissionError:
    sys.exit(1)
os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
os.write(1, b".")
while os.read(0, 1):
    os.write(1, b".")
"""


class IdleCore:
    """The last of this process's cores, from now on the firmware's alone. `close` it at the end."""

    def __init__(self) -> None:
        """Raises WireError on a machine that does not permit it."""
        self._before = os.sched_getaffinity(0)
        self.core = max(self._before)
        if len(self._before) < 2:
            raise WireError("deterministic = true needs a core for the firmware alone: this process may use one only")
        command = [sys.executable, "-S", "-E", "-c", _IDLE, str(self.core)]
        self._idle = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True
        )
        if self._answer() != b".":
            self.close()
            raise WireError(
                "deterministic = true needs real-time priorities (SCHED_FIFO) for the firmware: run it as root"
            )
        _use(self._before - {self.core})

    def settle(self) -> None:
        """Return once nothing on the core is left to do. Raises WireError for a firmware that never comes to rest."""
        assert self._idle.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._idle.stdin.write(b".")
        if self._answer() != b".":
            raise WireError(f"the firmware did not come to rest within {REST_S:g} s: see its log in the run's folder")

    def _answer(self) -> bytes:
        assert self._idle.stdout is not None
        ready = select.select([self._idle.stdout], [], [], REST_S)[0]
        return self._idle.stdout.read(1) if ready else b""

    def close(self) -> None:
        """Give the core back; may be called twice."""
        for pipe in (self._idle.stdin, self._idle.stdout):
            if pipe is not None:
                pipe.close()
        self._idle.kill()
        self._idle.wait()
        _use(self._before)


class SettledWire:
    """A wire to the firmware around another one: what is sent has been processed before `send` returns."""

    def __init__(self, wire: Any, core: IdleCore) -> None:
        self._wire, self._core = wire, core

    def send(self, data: bytes) -> None:
        self._wire.send(data)
        self._core.settle()

    def receive(self) -> list[bytes]:
        return self._wire.receive()

    def close(self) -> None:
        self._wire.close()


class SettledServer(SimulatorServer):
    """The simulator link to the firmware: sensors have been processed before `send` returns.

    While PX4's start script runs, which waits for the clock now and then, each step also waits for that.
    """

    def __init__(self, host: str, port: int, core: IdleCore, starting: Callable[[], Collection[int] | None]) -> None:
        """`starting`: commands of the firmware's start script under way, None once it has ended.

        Raises WireError for a port that is in use or may not be bound.
        """
        super().__init__(host, port)
        self._core, self._starting, self._started = core, starting, False

    def accept(self, limit_s: float = CONNECT_S, ended: Callable[[], str] = lambda: "") -> None:
        super().accept(limit_s, ended)
        self._started = False
        self._settle()

    def send(self, data: bytes) -> None:
        super().send(data)
        self._settle()

    def _settle(self) -> None:
        self._core.settle()
        before: Collection[int] = ()
        while not self._started:
            now = self._starting()
            if now and now == before:
                return
            self._started, before = now is None, now or ()
            time.sleep(COMMAND_S)
            self._core.settle()


def _use(cores: Collection[int]) -> None:
    """Let all threads of this process run on these cores."""
    for thread in Path("/proc/self/task").iterdir():
        with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
            os.sched_setaffinity(int(thread.name), cores)
