"""The timetable of a run's faults: publishes which of them act now. It decorates the director, which has the stage."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from hil.contract.messages import BoardState, Event, Faults, Stage, VehicleState, VehicleStatus
from hil.contract.node import Inbox, Node, Out
from hil.faults.node import TOPIC
from scenarios.faults import FaultTable

_REPEAT_NS = 50_000_000  # a reader may have missed a change
_READ = ("mocap/vehicle", "mocap/board", "board/detection")


class Timetable(Node):
    """Begins each fault when its condition is true for the first time, and ends it when its time is over."""

    def __init__(self, director: Node, faults: Sequence[FaultTable], sees: bool = True) -> None:
        """`sees`: the run has a camera, whose detections a condition may count."""
        self._director, self._faults, self._sees = director, faults, sees
        self._conditions = [fault.condition for fault in faults]
        self.name, self.wakes, self.period_ns = director.name, director.wakes, director.period_ns
        read = _READ if sees else tuple(topic for topic in _READ if topic != "board/detection")
        self.inputs = (*director.inputs, *(topic for topic in read if topic not in director.inputs))
        self.outputs = (*director.outputs, TOPIC)
        self._stage: Stage | None = None
        self._detections = 0
        self._begun_ns: dict[int, int] = {}
        self._published: tuple[int, ...] | None = None
        self._due_ns = 0

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        outs = self._director.step(now_ns, inbox)
        for out in outs:
            if out.topic == "run/stage":
                self._stage = out.message
        situation = self._situation(now_ns, inbox)
        for place, condition in enumerate(self._conditions):
            if place not in self._begun_ns and condition.holds(situation):
                self._begun_ns[place] = now_ns
        active = tuple(place for place in sorted(self._begun_ns) if self._lasts(place, now_ns))
        if active != self._published or now_ns >= self._due_ns:
            outs = [*outs, *self._changes(now_ns, active)]
            self._published, self._due_ns = active, now_ns + _REPEAT_NS
            outs.append(Out(TOPIC, Faults(now_ns, active, tuple(sorted(self._begun_ns)))))
        return outs

    def _lasts(self, place: int, now_ns: int) -> bool:
        lasts_s = self._faults[place].lasts_s
        return lasts_s is None or now_ns - self._begun_ns[place] < lasts_s * 1e9

    def _changes(self, now_ns: int, active: tuple[int, ...]) -> list[Out]:
        before = self._published or ()
        texts = [f"fault {self._faults[i].title} begins" for i in active if i not in before]
        texts += [f"fault {self._faults[i].title} ends" for i in before if i not in active]
        return [Out("event", Event(now_ns, "warning", "fault", text)) for text in texts]

    def _situation(self, now_ns: int, inbox: Inbox) -> Mapping[str, float | str | None]:
        """The quantities of `scenarios.faults.QUANTITIES`; None while unknown."""
        vehicle: VehicleState | None = inbox.latest("mocap/vehicle")
        board: BoardState | None = inbox.latest("mocap/board")
        status: VehicleStatus | None = inbox.latest("vehicle/status")
        stage = self._stage
        started = stage is not None and stage.name == "attempt"
        if started and self._sees:
            start_ns = stage.attempt_start_ns if stage else 0
            self._detections += sum(d.found and d.stamp_ns >= start_ns for d in inbox.new("board/detection"))
        return {
            "time": (now_ns - stage.attempt_start_ns) * 1e-9 if started and stage else None,
            "distance": math.dist(vehicle.position, board.position) if vehicle and board else None,
            "height": vehicle.position[2] if vehicle else None,
            "speed": math.hypot(*vehicle.velocity) if vehicle else None,
            "detections": float(self._detections) if started and self._sees else None,
            "stage": stage.name if stage else None,
            "phase": status.phase if status else None,
        }

    def abort(self, why: str) -> None:
        self._director.abort(why)

    @property
    def safe(self) -> bool:
        return self._director.safe

    @property
    def counters(self) -> Mapping[str, int]:
        return self._director.counters

    def close(self) -> None:
        self._director.close()
