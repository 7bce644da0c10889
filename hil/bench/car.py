"""The ground car on its bus: CAN mode, and a test of its own stop. It moves a few centimetres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from groundcar.scout.driver import Command, Feedback, ScoutLink, WrongProtocolError
from groundcar.scout.sim import ScoutSim
from hil.assembly.rig import Rig
from hil.bench.pace import Pace, Virtual, Wall
from hil.bench.reading import Unavailable
from hil.contract.wire import memory_pair
from scenarios.draw import Drawn

_MS = 1_000_000
_COMMAND_NS = 20 * _MS


@dataclass(frozen=True)
class StopReport:
    """Seconds after the last command was sent: `slowing` to 90 % of the speed, `standing` below 0.02 m/s."""

    speed: float  # m/s, when the commands ended
    slowing_s: float | None
    standing_s: float | None
    rolled_m: float


class CarBench:
    """Our driver on the bus of a real or a software Scout."""

    def __init__(self, pace: Pace, wire: Any, source: str) -> None:
        """Receives until the car grants CAN control, for two seconds at most. Raises Unavailable."""
        self._pace, self._clock, self._wire, self.source = pace, pace.clock, wire, source
        self._link = ScoutLink(wire)
        self.feedback = self._step()
        while self._clock.now_ns < 2_000_000_000 and not self._link.ready:
            self.feedback = self._step()
        if not self.feedback.stamp_ns:
            self.close()
            raise Unavailable(f"no frames come from the car: {source}")

    @classmethod
    def open(cls, rig: Rig, drawn: Drawn) -> CarBench:
        """The car of a rig. Raises Unavailable."""
        slot = rig.groundcar
        if slot.kind == "sim":
            pace = Virtual()
            ours, theirs = memory_pair(pace.clock, round(slot.wire_delay_ms * _MS))
            pace.devices.append(ScoutSim(theirs, seed=drawn.car_seed).step)
            return cls(pace, ours, "software Scout Mini, CAN in memory")
        from hil.wires import WireError
        from hil.wires.can import open_can

        try:
            wire = open_can(slot.interface, slot.channel)
        except WireError as error:
            raise Unavailable(str(error)) from None
        return cls(Wall(), wire, f"car on {slot.interface} {slot.channel}")

    def close(self) -> None:
        """Close the bus; nothing more is sent to the car."""
        self._wire.close()

    def try_stop(self, speed: float) -> StopReport:
        """Drive at `speed` (m/s) for a second, then send nothing. Raises Unavailable if it does not drive."""
        if not self._link.ready:
            raise Unavailable(f"the car does not take commands: mode {self.feedback.mode}, {self.feedback.fault}")
        self.feedback = feedback = self._step()  # process what has arrived since
        began = sent = self._clock.now_ns
        while self._clock.now_ns - began < 1_000_000_000:
            due = self._clock.now_ns - sent >= _COMMAND_NS
            sent = self._clock.now_ns if due else sent
            feedback = self._step(Command(self._clock.now_ns, speed, 0.0) if due else None)
        if feedback.speed < 0.5 * speed:
            raise Unavailable(f"the car was asked for {speed:g} m/s and drives {feedback.speed:.2f} m/s")
        at, rolled = feedback.speed, feedback.left_m
        slowing = standing = None
        while standing is None and self._clock.now_ns - sent < 3_000_000_000:
            feedback = self._step()
            after = (self._clock.now_ns - sent) * 1e-9
            slowing = after if slowing is None and feedback.speed < 0.9 * at else slowing
            standing = after if feedback.speed < 0.02 else None
        self.feedback = feedback
        return StopReport(at, slowing, standing, feedback.left_m - rolled)

    def try_curve(self, speed: float, turn_rate: float) -> tuple[float, float]:
        """Drive a curve (m/s, rad/s) for a second, then send nothing: (m, rad) by the wheels until it stands.

        Raises Unavailable if it takes no commands.
        """
        if not self._link.ready:
            raise Unavailable(f"the car does not take commands: mode {self.feedback.mode}, {self.feedback.fault}")
        began = sent = before = self._clock.now_ns
        moved = turned = 0.0
        while (since := self._clock.now_ns - began) < 3_000_000_000:
            due = since < 1_000_000_000 and self._clock.now_ns - sent >= _COMMAND_NS
            sent = self._clock.now_ns if due else sent
            self.feedback = self._step(Command(self._clock.now_ns, speed, turn_rate) if due else None)
            passed, before = (self._clock.now_ns - before) * 1e-9, self._clock.now_ns
            moved, turned = moved + passed * self.feedback.speed, turned + passed * self.feedback.turn_rate
        return moved, turned

    def _step(self, command: Command | None = None) -> Feedback:
        self._pace()
        try:
            return self._link.step(self._clock.now_ns, command)
        except WrongProtocolError as error:
            raise Unavailable(str(error)) from None
