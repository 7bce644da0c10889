"""The run's stages: waits for the hover, lets the car drive, opens the attempt, closes it after the verdict."""

from __future__ import annotations

from hil.contract.messages import Contact, Event, Stage, VehicleStatus
from hil.contract.node import Inbox, Node, Out

_REPEAT_NS = 50_000_000  # a change is published at once, and every stage again: a reader may have missed it
_LOST = ("failed", "interrupted", "killed")  # phases of the driver from which no attempt can begin


class Director(Node):
    """prepare -> lead (the car drives) -> attempt (the policy may engage) -> ended."""

    name = "director"
    inputs = ("vehicle/status", "referee/contact")
    outputs = ("run/stage", "event")
    period_ns = 10_000_000

    def __init__(self, lead_ns: int, prepare_limit_ns: int, after_ns: int = 400_000_000) -> None:
        """`lead_ns`: the car drives this long before the attempt; `after_ns`: recorded after the verdict."""
        self._lead_ns, self._limit_ns, self._after_ns = lead_ns, prepare_limit_ns, after_ns
        self._stage = "prepare"
        self._car_start_ns = self._attempt_ns = self._end_ns = self._publish_ns = 0
        self.failure = ""

    @property
    def stage(self) -> str:
        return self._stage

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        outs: list[Out] = []
        before = self._stage
        if self._stage == "prepare":
            status: VehicleStatus | None = inbox.latest("vehicle/status")
            if status and status.phase == "hover":
                self._stage, self._car_start_ns = "lead", now_ns
                self._attempt_ns = now_ns + self._lead_ns
            elif status and status.phase in _LOST:
                self._fail(f"the vehicle did not reach its start ({status.phase})")
            elif now_ns > self._limit_ns:
                phase = status.phase if status else "unknown"
                self._fail(f"the vehicle was not hovering at its start after {now_ns / 1e9:.0f} s (phase {phase})")
        if self._stage == "lead":
            status = inbox.latest("vehicle/status")
            if status and status.phase in _LOST:
                self._fail(f"the vehicle was lost before the attempt ({status.phase})")
            elif now_ns >= self._attempt_ns:
                self._stage = "attempt"
        if self._stage == "attempt":
            contact: Contact | None = inbox.latest("referee/contact")
            if contact and contact.outcome != "ongoing":
                self._end_ns = self._end_ns or now_ns + self._after_ns
                if now_ns >= self._end_ns:
                    self._stage = "ended"
        if self._stage != before:
            outs.append(Out("event", Event(now_ns, "error" if self.failure else "info", self.name, self._text())))
        if self._stage != before or now_ns >= self._publish_ns:
            self._publish_ns = now_ns + _REPEAT_NS
            outs.append(Out("run/stage", Stage(now_ns, self._stage, self._attempt_ns, self._car_start_ns)))
        return outs

    def _fail(self, why: str) -> None:
        self._stage, self.failure = "ended", why

    def _text(self) -> str:
        return self.failure or f"stage {self._stage}"
