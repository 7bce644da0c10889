"""The autopilot on the bench, real or simulated: the messages that it sends at rest and disarmed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from hil.assembly.rig import Rig
from hil.assembly.vehicle import vehicle_signing
from hil.bench.pace import Pace, Virtual, Wall
from hil.bench.reading import Unavailable
from hil.contract.wire import ByteWire, memory_pair
from scenarios.draw import Drawn
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import Frame
from vehicle.px4.driver.arming import Identity
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.params import read_value
from vehicle.px4.driver.types import LinkConfig, LinkOutput, Rates
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import Airframe

_MS = 1_000_000
_ANSWER_LIMIT_NS = 20_000_000_000
_RECEIVE_NS = 2_000_000_000
_HEALTH_LIMIT_NS = 10_000_000_000  # a PX4 that has just booted needs five seconds
_ASKED, _ANSWER_STEPS = 3, 250  # requests, and steps of two milliseconds to wait for the answer of each
_START = (0.0, 0.0, 2.5, 0.0)


@dataclass
class GroundReport:
    """What the autopilot sends, at rest and disarmed, after the driver has set its parameters."""

    received: dict[str, list[tuple[int, Any]]]
    parameters: dict[str, float]
    until_ns: int  # our time at the end of receiving
    listened_ns: int
    round_trip_ns: int
    clock_offset_ns: int
    notes: list[str] = field(default_factory=list)
    source: str = ""

    def latest(self, name: str) -> Any:
        """The newest message of that name. Raises Unavailable if none came."""
        if not self.received.get(name):
            raise Unavailable(f"the autopilot sent no {name} in {self.listened_ns * 1e-9:g} s")
        return self.received[name][-1][1]

    def rate_hz(self, name: str) -> float:
        """Messages per second while receiving."""
        count = sum(now >= self.until_ns - self.listened_ns for now, _ in self.received.get(name, ()))
        return count / (self.listened_ns * 1e-9)


class Bench:
    """The driver, which does not arm here, on a wire to a real or a simulated autopilot; what this says is kept.

    `received`: (our ns, fields) by name of the message; `read`: parameters by name, of those that were asked for.
    """

    def __init__(self, pace: Pace, wire: ByteWire, config: LinkConfig, source: str) -> None:
        self.pace, self.clock, self.source = pace, pace.clock, source
        self._wire = wire
        self.received: dict[str, list[tuple[int, Any]]] = {}
        self.read: dict[str, float] = {}
        self._told: dict[str, float] = {}
        self.link = Px4Link(wire, config, self._listen)
        self.notes: list[str] = []

    def _listen(self, frame: Frame) -> None:
        if frame.name != "PARAM_VALUE":
            self.received.setdefault(frame.name, []).append((self.clock.now_ns, frame.fields))
            return
        name, value, _ = read_value(frame.payload)
        if value is not None:
            self._told[name] = value

    def drain(self) -> None:
        """Discard waiting frames and stored messages."""
        while self._wire.receive():
            pass
        self.received.clear()

    def step(self, command: Rates | None = None) -> LinkOutput:
        """Two milliseconds."""
        self.pace()
        output = self.link.step(self.clock.now_ns, command)
        self.notes += [note.text for note in output.notes if note.severity != "info"]
        return output

    def parameter(self, name: str) -> float:
        """Its value as the autopilot holds it now. Raises KeyError if it does not answer."""
        self._told.pop(name, None)
        if not self._answered(lambda: self.link.ask_parameter(name), lambda: name in self._told):
            raise KeyError(name)
        self.read[name] = self._told[name]
        return self.read[name]

    def identity(self) -> Identity:
        """Which autopilot it is. Raises Unavailable if it does not tell its UID."""
        self._answered(self.link.ask_identity, lambda: self.link.identity is not None)
        found = self.link.identity
        if found is None or not found.uid:
            raise Unavailable(f"{self.source} does not tell its UID (AUTOPILOT_VERSION)")
        return found

    def _answered(self, ask: Callable[[], None], answer: Callable[[], bool]) -> bool:
        """Ask up to three times; whether the answer came."""
        for _ in range(_ASKED):
            ask()
            for _ in range(_ANSWER_STEPS):
                self.step()
                if answer():
                    return True
        return False

    def close(self) -> None:
        """Close the wire."""
        self._wire.close()


class SimulatedBench(Bench):
    """A software PX4 on a wire in memory, in virtual time."""

    def __init__(self, airframe: Airframe, rig: Rig, drawn: Drawn, *, arm: bool = False) -> None:
        pace = Virtual()
        ours, theirs = memory_pair(pace.clock, round(rig.vehicle.wire_delay_ms * _MS))
        self.sim = Px4Sim({"api": theirs}, airframe, drawn.vehicle_seed)
        pace.devices.append(self.sim.step)
        config = LinkConfig(start=_START, hover_thrust=airframe.hover_thrust, arm=arm)
        super().__init__(pace, ours, config, "software PX4, MAVLink in memory")


def live_bench(airframe: Airframe, rig: Rig) -> Bench:
    """The autopilot at the rig's address. Raises Unavailable if the wire or the signing key cannot be used."""
    from hil.wires import WireError
    from hil.wires.url import open_url

    slot = rig.vehicle
    pace = Wall()
    try:
        signing = vehicle_signing(slot.signing_key, time.time_ns() - pace.clock.now_ns)
        wire = open_url(slot.url, slot.system)
    except (WireError, ValueError) as error:
        raise Unavailable(str(error)) from None
    config = LinkConfig(
        start=_START,
        hover_thrust=airframe.hover_thrust,
        system=slot.system,
        component=slot.component,
        clock_drift=slot.clock_drift,
        signing=signing,
        arm=False,
    )
    return Bench(pace, wire, config, f"autopilot at {slot.url}")


def read_ground(bench: Bench) -> GroundReport:
    """Let the driver set its parameters and streams if it has not yet, then receive for two seconds.

    Raises Unavailable if it gets no answer. The vehicle is not armed.
    """
    began = bench.clock.now_ns
    bench.drain()
    while bench.link.phase in ("connect", "parameters", "streams"):
        bench.step()
        if bench.link.phase == "failed" or bench.clock.now_ns - began > _ANSWER_LIMIT_NS:
            raise Unavailable(f"no working link to {bench.source}: {'; '.join(bench.notes[-2:]) or bench.link.phase}")
    since = bench.clock.now_ns
    fine = False
    while bench.clock.now_ns - since < (_RECEIVE_NS if fine else _HEALTH_LIMIT_NS):
        bench.step()
        status = bench.received.get("SYS_STATUS")
        fine = bool(status and status[-1][1].onboard_control_sensors_health & px4.PREARM_CHECK)
    counters = bench.link.counters
    return GroundReport(
        received=bench.received,
        parameters=_Parameters(bench),
        until_ns=bench.clock.now_ns,
        listened_ns=bench.clock.now_ns - since,
        round_trip_ns=counters["round_trip_ns"],
        clock_offset_ns=counters["clock_offset_ns"],
        notes=bench.notes,
        source=bench.source,
    )


class _Parameters(dict[str, float]):
    """Parameters by name, each read from the autopilot when first asked for; KeyError if it does not answer."""

    def __init__(self, bench: Bench) -> None:
        super().__init__()
        self._bench = bench

    def __missing__(self, name: str) -> float:
        self[name] = value = self._bench.parameter(name)
        return value
