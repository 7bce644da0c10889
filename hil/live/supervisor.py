"""Starts the processes of a live run in order, monitors their topics and health, and stops them in order.

A process that ends, or whose topics grow old, aborts the run: nothing is restarted in flight, and every remaining
service is ordered to bring its device to the safe state.
"""

# In the safe state the vehicle's driver returns control to the autopilot, which lands; the car's driver commands zero
# speed. If one of these two drivers has ended, the missing commands have the same effect: the autopilot's failsafe and
# the car's own watchdog act on them. If the hub or the supervisor has ended, every service detects bus silence and
# enters its safe state by itself.

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hil.bus.leaf import CONTROL, HEALTH, Bus, BusError
from hil.contract.messages import Event
from hil.contract.topics import TOPICS
from hil.live.messages.floods import Floods
from hil.live.messages.health_book import HealthBook
from hil.live.orphaned import mapped_memory
from hil.live.process import Process
from hil.live.run_clock import clock_fault
from hil.live.spec import disagreement
from hil.safety.topic_liveness import NOT_WATCHED, liveness_fault
from hil.scoring.score import ABORTED
from vehicle.px4.driver.arming import Arming

READY_LIMIT_S = 600.0  # kernels may have to be compiled
_LENIENT_NS, _LENIENT_EVERY_NS = 600_000_000, 3_000_000_000  # services publish their health twice a second
_BEAT_S = 0.2
_STOP_S = 4.0
_GRACE_S = 2.0  # from SIGTERM to SIGKILL
_RECORDER_S, _RECORDER_GRACE_S = 15.0, 6.0  # it still has to write the last messages


class SupervisorError(RuntimeError):
    """The services could not be started; the text states which and why."""


class Supervisor:
    """The processes of one run. Use as a context manager: leaving it leaves no process behind."""

    def __init__(
        self,
        spec: Path,
        endpoint: str,
        logs: Path,
        remote: Sequence[str] = (),
        serves: Mapping[str, str] | None = None,
    ) -> None:
        """Services in `remote` are not started here; all must be built for the run `serves` (`run_digests`)."""
        self._spec, self._endpoint, self._logs = spec, endpoint, logs
        self._remote, self._serves = [s for s in remote if s != "hub"], dict(serves or {})
        self._processes: dict[str, Process] = {}
        self._bus: Bus | None = None
        self._book = HealthBook()
        self.health, self.memory = self._book.health, self._book.memory
        self.floods: Floods | None = None
        self._received: dict[str, int] = {}
        self._started_ns = self._stood_still_ns = 0
        self._standing: dict[str, Any] = {"order": "watch"}
        self._beaten_s = 0.0
        self._warned: set[str] = set()
        self.remarks: list[str] = []

    def start(self, service: str) -> None:
        """Start one service's process."""
        command = [sys.executable, "-m", "hil.live.main", str(self._spec), service]
        self._processes[service] = Process(service, command, self._logs / f"{service}.log")

    def connect(self, credentials: Any = None, limit_s: float = 30.0) -> Bus:
        """Join the bus once the hub is up. Raises SupervisorError if the hub ends instead."""
        until = time.monotonic() + limit_s
        while True:
            self._check_ended()
            try:
                self._bus = Bus(self._endpoint, credentials, timeout_s=1.0, identity="supervisor")
                break
            except BusError as error:
                if time.monotonic() > until:
                    raise SupervisorError(str(error)) from None
        self._bus.on_table(HEALTH + "*", self._book.note)
        self.floods = Floods(self._bus, self.health)
        watched = [t for t, row in TOPICS.items() if row.hz and t not in NOT_WATCHED]
        self._received = self._bus.ages(watched, self.floods.counts)
        return self._bus

    def wait_ready(
        self, services: Iterable[str], limit_s: float = READY_LIMIT_S, waiting: Callable[[list[str]], None] = print
    ) -> None:
        """Until all are ready. Raises SupervisorError naming a service that ended, that is not ready in time, that
        was built for another run or from other files, or whose clock on another host cannot be compared."""
        services, until = list(services), time.monotonic() + limit_s
        while True:
            self.beat()
            missing = [s for s in services if self.health.get(s, {}).get("state") != "ready"]
            self._check_built()
            double = self._book.double()
            if double:
                raise SupervisorError(double)
            if not missing:
                for process in self._processes.values():  # the hub publishes no health
                    self.memory.update(mapped_memory(process.pid))
                return
            self._check_ended()
            if time.monotonic() > until:
                raise SupervisorError(f"not ready after {limit_s:.0f} s: {', '.join(missing)} (see {self._logs})")
            waiting(missing)
            time.sleep(0.1)

    def _check_built(self) -> None:
        for service, table in list(self.health.items()):
            remote, serves = service in self._remote, table.get("serves")
            if remote or serves is not None:  # the recorder builds nothing
                read = serves if isinstance(serves, Mapping) else {}
                fault = disagreement(service, read, self._serves, remote=remote)
                if fault:
                    raise SupervisorError(fault)
            if not remote:
                continue
            fault = clock_fault(service, table.get("clock", {}))
            if fault:
                raise SupervisorError(fault)

    def go(self, delay_s: float = 0.6, ahead_ns: int = 0, arming: Arming | None = None) -> int:
        """Start the run's clock `delay_s` from now, everywhere; returns its zero on the monotonic clock (ns).

        `ahead_ns`: the hub's monotonic clock less ours. `arming`: what a real vehicle must be and hold to be armed.
        """
        assert self._bus is not None
        self._started_ns = time.monotonic_ns() + round(delay_s * 1e9)
        order = {"order": "go", "epoch_ns": self._started_ns + ahead_ns, "sessions": self._book.fix()}
        self._order({**order, "arming": (arming or Arming()).table()})
        return self._started_ns

    def report(self, severity: str, text: str) -> None:
        """Publish an event at the run's time."""
        if self._bus is not None:
            now_ns = max(0, time.monotonic_ns() - self._started_ns)
            self._bus.publish(now_ns, "event", Event(now_ns, severity, "supervisor", text))

    def warnings(self) -> list[str]:
        """What does not end the run and is worth a remark, each once: floods, a second process of a service."""
        found = [self._book.double(), self.floods.warning() if self.floods is not None else ""]
        fresh = [text for text in found if text and text.partition(" (")[0] not in self._warned]
        self._warned.update(text.partition(" (")[0] for text in fresh)
        return fresh

    def beat(self) -> None:
        """Publish the order that stands, which shows the supervisor's liveness; to be called several times a second."""
        now = time.monotonic()
        if self._bus is not None and now - self._beaten_s > _BEAT_S:
            self._beaten_s = now
            self._bus.send_table(CONTROL, {**self._standing, "session": self._bus.session})

    def _order(self, order: dict[str, Any]) -> None:
        """Send an order to all services, again with every beat: the bus may lose one."""
        self._standing, self._beaten_s = order, 0.0
        self.beat()

    def stood_still(self) -> None:
        """This computer stood still: what has come meanwhile is read before a service is judged by it. Not again for
        3 s, or a computer that does nothing else would hide every fault."""
        now = time.monotonic_ns()
        if now - self._stood_still_ns > _LENIENT_EVERY_NS:
            self._stood_still_ns = now

    def trouble(self) -> str:
        """Which process has ended or does not publish, as text; empty while there is no fault."""
        for process in self._processes.values():
            if process.ended() is not None:
                return self._why(process)
        now = time.monotonic_ns()
        if now < self._started_ns or now - self._stood_still_ns < _LENIENT_NS:
            return ""
        fault = liveness_fault(now, self.health, self._received, self._watched())
        if not fault:
            return ""
        return next((self._why(one) for one in self._processes.values() if one.leaving() is not None), fault)

    def _why(self, process: Process) -> str:
        """How it ended; with the cause from its last health where its log lacks it (a full disk)."""
        text, table = process.why(), self.health.get(process.name, {})
        return f"{text}: {table['why']}" if ": " not in text and table.get("state") == "failed" else text

    def _watched(self) -> list[str]:
        return [*(name for name in self._processes if name != "hub"), *self._remote]

    def abort(self, why: str) -> None:
        """Order all remaining services to reach their safe state. The recording says since when nothing is scored."""
        if self._started_ns:
            self.report("warning", ABORTED + why)
        self._order({"order": "abort", "why": why})

    def safe(self, service: str) -> bool:
        """Whether `service` reports that what it drives is safe; True if it has ended or cannot report."""
        process, table = self._processes.get(service), self.health.get(service)
        if (process is None and service not in self._remote) or table is None:
            return True
        if process is not None and process.ended() is not None:
            return True
        if self._alone(process):
            return False
        overdue = time.monotonic_ns() - table["received_ns"] > 3e9
        return overdue or bool(table.get("safe", True))

    def _alone(self, process: Process | None) -> bool:
        """The hub has ended and the service was healthy: it enters its safe state by itself, and then ends."""
        hub = self._processes.get("hub")
        return process is not None and hub is not None and hub.ended() is not None and not process.stopped()

    def drop_hub(self) -> None:
        """End a hub that does not answer, so that every service detects it at once."""
        hub = self._processes.get("hub")
        if hub is not None:
            hub.end(0.0)

    def stop(self) -> None:
        """Stop in reverse order of starting, the recorder after all services, the hub last."""
        order = [s for s in reversed(self._processes) if s not in ("recorder", "hub")]
        for service in self._remote:
            self._order_stop(service)
        for service in [*order, "recorder", "hub"]:
            process = self._processes.get(service)
            if process is None:
                continue
            if service == "hub":
                self._await_remote()
                self._leave()
                if process.ended() is None:
                    os.kill(process.pid, signal.SIGTERM)
            elif process.ended() is None:
                self._order_stop(service)
            patience_s, grace_s = (_RECORDER_S, _RECORDER_GRACE_S) if service == "recorder" else (_STOP_S, _GRACE_S)
            ended = process.ended() is not None
            remark = process.end(patience_s if self._hub_lives() else 0.0, self.beat, grace_s)
            if service == "recorder" and not (remark or ended) and process.ended():
                remark = self._why(process)
            if remark:
                self.remarks.append(remark)
        self._processes.clear()
        self._leave()

    def _order_stop(self, service: str) -> None:
        if self._bus is not None:
            self._bus.send_table(CONTROL, {"order": "stop", "service": service, "session": self._bus.session})

    def _hub_lives(self) -> bool:
        hub = self._processes.get("hub")
        return hub is None or hub.ended() is None

    def _await_remote(self) -> None:
        """Give the remote services a moment to report that they have stopped."""
        until = time.monotonic() + _STOP_S
        while self._hub_lives() and time.monotonic() < until:
            left = [s for s in self._remote if self.health.get(s, {}).get("state", "stopped") != "stopped"]
            if not left:
                return
            time.sleep(0.05)
        self.remarks += [
            f"{s} on its other host did not report that it stopped"
            for s in self._remote
            if self.health.get(s, {}).get("state", "stopped") != "stopped"
        ]

    def _leave(self) -> None:
        if self._bus is not None:
            self._bus.close()
            self._bus = None

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
            self._leave()
