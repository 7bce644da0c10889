"""Starts the processes of a live run in order, watches them by what they publish, stops them in order.

Nothing is restarted in flight. A process that ends, or whose topics grow old, is an abort: every service that is left
is told, and brings what it drives to its safe state: the vehicle's driver hands back to the autopilot, which lands; the
car's driver commands zero speed. If it is one of those two that is gone, silence does the same: the autopilot's
failsafe and the car's own watchdog act on it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from hil.bus import CONTROL, HEALTH, Bus, BusError
from hil.topics import TOPICS

AGE_LIMIT_S = 1.0  # a topic silent for longer than this, or ten times its contract's age, is an abort
READY_LIMIT_S = 600.0  # kernels may have to be compiled
_STOP_S = 4.0
_QUIET = ("camera/image", "vehicle/sent")  # big, or silent by design once the gate or the referee has spoken
_ENVIRONMENT = {
    # one thread a process: they are many; freed picture buffers stay with the process instead of being mapped anew
    **dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
    **dict.fromkeys(("MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_", "MALLOC_TOP_PAD_"), "67108864"),
}


class SupervisorError(RuntimeError):
    """The services could not be brought up; the text says which and why."""


class Process:
    """One service's process; its output goes to `log`."""

    def __init__(self, name: str, command: list[str], log: Path) -> None:
        self.name, self.log = name, log
        with log.open("wb") as file:
            self._popen = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
                env={**os.environ, **_ENVIRONMENT}, start_new_session=True,
            )  # fmt: skip
        self.pid = self._popen.pid

    def ended(self) -> int | None:
        """Exit code (negative: the signal), or None while it runs."""
        return self._popen.poll()

    def last_words(self) -> str:
        """The last line it wrote."""
        lines = self.log.read_text(errors="replace").strip().splitlines()
        return lines[-1].removeprefix("perch-hil: ") if lines else ""

    def why(self) -> str:
        """How it ended, in words."""
        code = self.ended()
        if code is None:
            return f"{self.name} runs"
        how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
        words = self.last_words()
        return f"{self.name} {how}" + (f": {words}" if words else "")

    def end(self, patience_s: float) -> str:
        """Wait `patience_s`, then SIGTERM, then SIGKILL. Returns what it took beyond patience."""
        try:
            self._popen.wait(patience_s)
            return ""
        except subprocess.TimeoutExpired:
            pass
        for number in (signal.SIGTERM, signal.SIGKILL):
            self._popen.send_signal(number)
            try:
                self._popen.wait(2.0)
                return f"{self.name} had to be stopped with {number.name}"
            except subprocess.TimeoutExpired:
                continue
        return f"{self.name} cannot be stopped"


class Supervisor:
    """The processes of one run. Use as a context manager: leaving it leaves no process behind."""

    def __init__(self, spec: Path, endpoint: str, logs: Path) -> None:
        self._spec, self._endpoint, self._logs = spec, endpoint, logs
        self._processes: dict[str, Process] = {}
        self._bus: Bus | None = None
        self.health: dict[str, dict[str, Any]] = {}
        self._heard: dict[str, int] = {}
        self._started_ns = 0
        self.remarks: list[str] = []

    def start(self, service: str) -> None:
        """Start one service's process."""
        command = [sys.executable, "-m", "hil.host.live_main", str(self._spec), service]
        self._processes[service] = Process(service, command, self._logs / f"{service}.log")

    def connect(self, credentials: Any = None, limit_s: float = 30.0) -> Bus:
        """Join the bus once the hub is up. Raises SupervisorError if the hub ends instead."""
        until = time.monotonic() + limit_s
        while True:
            self._check_ended()
            try:
                self._bus = Bus(self._endpoint, credentials, timeout_s=1.0)
                break
            except BusError as error:
                if time.monotonic() > until:
                    raise SupervisorError(str(error)) from None
        self._bus.hear(HEALTH + "*", self._note)
        self._heard = self._bus.ages([t for t, row in TOPICS.items() if row.hz and t not in _QUIET])
        return self._bus

    def _note(self, table: dict[str, Any]) -> None:
        self.health[str(table.get("service"))] = {**table, "heard_ns": time.monotonic_ns()}

    def wait_ready(
        self, services: Iterable[str], limit_s: float = READY_LIMIT_S, waiting: Callable[[list[str]], None] = print
    ) -> None:
        """Until all are ready. Raises SupervisorError naming who ended, or who is not ready in time."""
        services, until = list(services), time.monotonic() + limit_s
        while True:
            missing = [s for s in services if self.health.get(s, {}).get("state") != "ready"]
            if not missing:
                return
            self._check_ended()
            if time.monotonic() > until:
                raise SupervisorError(f"not ready after {limit_s:.0f} s: {', '.join(missing)} (see {self._logs})")
            waiting(missing)
            time.sleep(0.1)

    def go(self, delay_s: float = 0.6) -> int:
        """Start the run's clock `delay_s` from now, everywhere; returns its zero on the monotonic clock (ns)."""
        assert self._bus is not None
        self._started_ns = time.monotonic_ns() + round(delay_s * 1e9)
        self._bus.say(CONTROL, {"order": "go", "epoch_ns": self._started_ns})
        return self._started_ns

    def trouble(self) -> str:
        """Who ended, or which topic or service has fallen silent since the start; empty while all is well."""
        for process in self._processes.values():
            if process.ended() is not None:
                return process.why()
        now = time.monotonic_ns()
        if now < self._started_ns:
            return ""
        for service, table in list(self.health.items()):
            if service in self._processes and now - table["heard_ns"] > (AGE_LIMIT_S + 1.0) * 1e9:
                return f"{service} does not answer: silent for {(now - table['heard_ns']) / 1e9:.1f} s"
        for topic, heard_ns in list(self._heard.items()):
            if now - heard_ns > max(AGE_LIMIT_S * 1e9, TOPICS[topic].max_age_ms * 1e7):
                return f"{self._producer(topic)} is silent on {topic} for {(now - heard_ns) / 1e9:.1f} s"
        return ""

    def _producer(self, topic: str) -> str:
        for service, table in self.health.items():
            if topic in table.get("outputs", ()):
                return service
        return "somebody"

    def abort(self, why: str) -> None:
        """Tell everybody who is left to reach the safe state."""
        assert self._bus is not None
        self._bus.say(CONTROL, {"order": "abort", "why": why})

    def safe(self, service: str) -> bool:
        """Whether `service` says that what it drives is safe; True if it can say nothing any more."""
        process, table = self._processes.get(service), self.health.get(service)
        if process is None or process.ended() is not None or table is None:
            return True
        silent = time.monotonic_ns() - table["heard_ns"] > 3e9
        return silent or bool(table.get("safe", True))

    def stop(self) -> None:
        """Stop in reverse order of starting, the recorder after all services, the hub last."""
        order = [s for s in reversed(self._processes) if s not in ("recorder", "hub")]
        for service in [*order, "recorder", "hub"]:
            process = self._processes.get(service)
            if process is None:
                continue
            if self._bus is not None and process.ended() is None and service != "hub":
                self._bus.say(CONTROL, {"order": "stop", "service": service})
            if service == "hub":
                if self._bus is not None:
                    self._bus.close()
                    self._bus = None
                if process.ended() is None:
                    os.kill(process.pid, signal.SIGTERM)
            remark = process.end(_STOP_S)
            if remark:
                self.remarks.append(remark)
        self._processes.clear()

    def _check_ended(self) -> None:
        for process in self._processes.values():
            if process.ended() is not None:
                raise SupervisorError(f"{process.why()} (see {process.log})")

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.stop()
        finally:
            for process in self._processes.values():
                process.end(0.0)
            if self._bus is not None:
                self._bus.close()


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
