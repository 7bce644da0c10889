"""The live host: one process steps a few nodes in real time over the bus, with absolute deadlines.

It waits for messages and wires, obeys orders, publishes its health, and brings its devices to the safe state when it is
ordered to, or when the supervisor is lost. The nodes' deadlines are in `hil/live/schedule.py`.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

from hil.assembly.simulation import counters
from hil.bus.leaf import CONTROL, HEALTH, Bus, Mailbox
from hil.contract.messages import Event
from hil.contract.node import Node
from hil.live.graph import declare
from hil.live.liveness import Presence, footprint
from hil.live.messages.log import log_line
from hil.live.messages.orders import Orders
from hil.live.run_clock import RunTime
from hil.live.schedule import Schedule
from hil.recording.receipts import ReceiptBook

_WIRE_REST_NS = 1_000_000  # a flood on a wire may not keep its driver busy
_HEALTH_NS = 500_000_000
_IDLE_NS = 100_000_000
_SAFE_LIMIT_NS = 20_000_000_000
_LINGER_NS = 2_000_000_000  # zero speed has to be sent, and an autopilot reports only once a second that it is disarmed


class LiveService:
    """Drives `nodes` until ordered to stop. `trouble` names wires that were lost."""

    def __init__(
        self,
        name: str,
        nodes: Sequence[Node],
        bus: Bus,
        run_time: RunTime,
        *,
        presence: Presence | None = None,
        book: ReceiptBook | None = None,
        trouble: Callable[[], list[str]] = list,
        serves: Mapping[str, str] | None = None,
        descriptors: Mapping[int, str] | None = None,
        phase_ns: int = 0,
        step_priority: AbstractContextManager[None] | None = None,
        remarks: Sequence[str] = (),
    ) -> None:
        """`presence` watches for the supervisor; `serves` says for which run this process was built (`run_digests`).

        `descriptors`: of wires that wake a node, whose period then only has to be kept as far as `WIRE_PERIOD_NS`.
        `phase_ns`: when the first deadlines are, after the run's start. `step_priority` is entered for every step.
        `remarks` are published as warnings.
        """
        self.name, self._bus, self._time, self._serves = name, bus, run_time, dict(serves or {})
        self._presence = presence or Presence()
        self._trouble, self._phase_ns, self._remarks = trouble, phase_ns, remarks
        wires = descriptors or {}
        self._schedule = Schedule(
            nodes, self._publish, run_time.now, book=book, wired=set(wires.values()), step_priority=step_priority
        )
        ranks = {node.name: rank for rank, node in enumerate(nodes)}
        self._wired = {fd: ranks[node] for fd, node in wires.items() if node in ranks}
        self._quiet_ns = dict.fromkeys(self._wired, 0)  # until then a wire does not wake its node again
        self._mailbox = Mailbox(urgent=self._schedule.urgent)
        produced = {topic for node in nodes for topic in node.outputs}
        for node in nodes:  # what is made in this process is passed on within it
            bus.subscribe(node.name, [t for t in node.inputs if t not in produced], self._mailbox)
        bus.announce(sorted(produced))
        self._orders = Orders(name, bus.session)
        bus.on_table(CONTROL, self._order)
        self._health_ns = 0
        self._stop = self._gone = False
        self._abort_ns: int | None = None
        self._safe_ns: int | None = None
        self._why = ""
        self._reported: set[str] = set()

    def _order(self, table: dict[str, Any]) -> None:
        if self._orders.put(table):
            self._presence.received()
            if table["order"] != "watch":
                self._mailbox.wake()

    def stop(self) -> None:
        """End as soon as the step under way is done (safe in a signal handler)."""
        self._stop = True
        self._mailbox.wake()

    @property
    def lost(self) -> bool:
        """Whether it ended because the supervisor was lost, or runs with another process of this service."""
        return self._gone

    def orphaned(self) -> None:
        """The supervisor may be lost: check it at once (safe in a signal handler)."""
        self._health_ns = 0
        self._mailbox.wake()

    def wait_for_go(self) -> bool:
        """Publish "ready" until the supervisor starts the run. False on an order to stop, or if the
        supervisor is lost."""
        while not self._stop:
            self._time.tick()
            self._publish_health(0, "ready")
            self._mailbox.wait(_IDLE_NS)
            for order in self._take_orders():
                if order["order"] == "go":
                    displaced = self._orders.displaced(order)
                    if displaced:
                        self._log(displaced)
                        self._gone = True
                        return False
                    for node in self._schedule.nodes:
                        node.permit(order.get("arming"))
                    self._time.begin(order["epoch_ns"])
            if self._time.begun:
                self._wait_for_start()
                self._mailbox.forget()
                return True
            gone = self._presence.gone()
            if gone:
                self._log(f"ended before the run began: {gone}")
                self._gone = True
                return False
        return False

    def _wait_for_start(self) -> None:
        """Until the run's time is 0: no node is stepped at a negative time, whatever arrives before."""
        while not self._stop and self._now() < 0:
            self._mailbox.wait(-self._now())

    def run(self) -> None:
        """Step the nodes from the run's start until stopped, aborted or orphaned."""
        self._schedule.begin(self._phase_ns)
        # Each service publishes its health at a time of its own: all at once they delayed pictures by 4 ms
        self._health_ns = zlib.crc32(self.name.encode()) % _HEALTH_NS
        while not self._stop:
            now = self._now()
            due = self._schedule.due_ns(self._health_ns)
            resting = [quiet_ns for quiet_ns in self._quiet_ns.values() if quiet_ns > now]
            due = min([due, *resting])
            active = [fd for fd, quiet_ns in self._quiet_ns.items() if quiet_ns <= now]
            self._turn(self._mailbox.wait(due - now, active) if due > now else [])

    def _turn(self, woken: Sequence[int] = ()) -> None:
        for order in self._take_orders():
            if order["order"] == "abort" and self._abort_ns is None:
                self._abort(str(order.get("why", "")))
        self._schedule.receive(self._mailbox.drain())
        for fd in woken:
            now = self._now()
            self._quiet_ns[fd] = now + _WIRE_REST_NS
            self._schedule.step(self._wired[fd], now)
        self._schedule.catch_up()
        now = self._now()
        if now >= self._health_ns:
            self._health_ns = now + _HEALTH_NS
            self._check(now)
        if self._gone and self._safe(now):
            self._stop = True

    def _check(self, now_ns: int) -> None:
        self._time.tick()
        self._publish_health(now_ns, "aborted" if self._abort_ns is not None else "running")
        if self._schedule.receipts_lost:
            self._report_once(now_ns, "warning", f"this run cannot be replayed: {self._schedule.receipts_lost}")
        if self._schedule.unpublished:
            self._report_once(now_ns, "error", self._schedule.unpublished)
        if self._orders.refused:
            self._report_once(now_ns, "warning", self._orders.refused)
        for topic in list(self._mailbox.strangers):
            self._report_once(now_ns, "warning", f"{topic} comes from a second process too, and is not taken from it")
        for text in self._trouble():
            self._report_once(now_ns, "error", text)
        for text in (*self._remarks, *self._time.remarks()):
            self._report_once(now_ns, "warning", text)
        gone = self._presence.gone()
        if gone and not self._gone:
            self._gone = True
            self._abort(gone)

    def _abort(self, why: str) -> None:
        """Bring what every node drives to its safe state."""
        if self._abort_ns is None:
            self._abort_ns, self._why = self._now(), why
            self._log(f"aborted at {self._abort_ns / 1e9:.3f} s: {why}")
        for node in self._schedule.nodes:
            node.abort(why)

    def _log(self, text: str) -> None:
        log_line(f"{self.name}: {text}")

    def _nodes_safe(self) -> bool:
        return all(node.safe for node in self._schedule.nodes)

    def _safe(self, now_ns: int) -> bool:
        """Whether this process may end: all has been safe for a while, or has had its time to become so."""
        if not self._nodes_safe():
            self._safe_ns = None
        elif self._safe_ns is None:
            self._safe_ns = now_ns
        settled = self._safe_ns is not None and now_ns - self._safe_ns > _LINGER_NS
        return settled or now_ns - (now_ns if self._abort_ns is None else self._abort_ns) > _SAFE_LIMIT_NS

    def _now(self) -> int:
        return self._time.now()

    def _take_orders(self) -> list[dict[str, Any]]:
        orders = self._orders.take()
        self._stop = self._stop or any(order["order"] == "stop" for order in orders)
        return orders

    def _publish(self, topic: str, message: Any) -> int:
        return self._bus.publish(self._now(), topic, message)

    def _report_once(self, now_ns: int, severity: str, text: str) -> None:
        if text not in self._reported:
            self._reported.add(text)
            self._bus.publish(now_ns, "event", Event(now_ns, severity, self.name, text))

    def _publish_health(self, now_ns: int, state: str) -> None:
        self._bus.send_table(HEALTH + self.name, self.health(now_ns, state))

    def health(self, now_ns: int, state: str) -> dict[str, Any]:
        """The health of this process, for the supervisor and `perch-hil status`."""
        mailbox = self._mailbox
        return {
            "service": self.name, "pid": os.getpid(), "host": os.uname().nodename, "session": self._bus.session,
            "state": state, "now_ns": now_ns,
            "outputs": sorted({topic for node in self._schedule.nodes for topic in node.outputs}),
            "nodes": {node: vars(pace) for node, pace in self._schedule.paces},
            "dropped": dict(mailbox.dropped), "lost": dict(mailbox.lost), "garbage": mailbox.garbage,
            "strangers": dict(mailbox.strangers),
            "counters": counters(self._schedule.nodes), "safe": self._nodes_safe(), "why": self._why,
            "clock": self._time.table(), **footprint(),
            **({"graph": declare(self._schedule.nodes), "serves": self._serves} if state == "ready" else {}),
        }  # fmt: skip

    def close(self) -> None:
        """Publish the last health, then close the nodes. The bus belongs to the caller."""
        if self._abort_ns is not None:
            self._log(f"{'safe' if self._nodes_safe() else 'NOT SAFE'} at the end")
        self._publish_health(self._now() if self._time.begun else 0, "stopped")
        self._schedule.close()
        self._mailbox.close()
