"""The autopilot on the bench, real or simulated: the messages that it sends at rest and disarmed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hil.assembly.rig import Rig
from hil.bench.pace import Pace, Virtual, Wall
from hil.bench.reading import Unavailable
from hil.contract.wire import ByteWire, memory_pair
from hil.host.lockstep import Clock
from scenarios.draw import Drawn
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES, Packer, Parser
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.params import READ, VALUE, unpack_value
from vehicle.px4.driver.types import LinkConfig, LinkOutput, Rates
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import Airframe

_MS = 1_000_000
_ANSWER_LIMIT_NS = 20_000_000_000
_RECEIVE_NS = 2_000_000_000
_HEALTH_LIMIT_NS = 10_000_000_000  # a PX4 that has just booted needs five seconds
_START = (0.0, 0.0, 2.5, 0.0)


class Tap:
    """A wire that stores the messages passing through: (our ns, fields) by name; parameters by name."""

    def __init__(self, wire: ByteWire, clock: Clock) -> None:
        self._wire, self._clock = wire, clock
        self._parser = Parser()
        self.received: dict[str, list[tuple[int, Any]]] = {}
        self.parameters: dict[str, float] = {}

    def send(self, data: bytes, /) -> None:
        self._wire.send(data)

    def drain(self) -> None:
        """Discard waiting frames and stored messages."""
        while self._wire.receive():
            pass
        self.received.clear()

    def receive(self) -> list[bytes]:
        datagrams = self._wire.receive()
        for data in datagrams:
            for frame in self._parser.feed(data):
                if frame.name == "PARAM_VALUE":
                    self._parameter(frame.payload)
                else:
                    self.received.setdefault(frame.name, []).append((self._clock.now_ns, frame.fields))
        return datagrams

    def close(self) -> None:
        self._wire.close()

    def _parameter(self, payload: bytes) -> None:
        four, _, _, raw, kind = VALUE.unpack(payload.ljust(VALUE.size, b"\0"))
        value = unpack_value(four, kind)
        if value is not None:
            self.parameters[raw.split(b"\0", 1)[0].decode("ascii", "replace")] = value


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
    """The driver, which does not arm here, on a tapped wire to a real or a simulated autopilot."""

    def __init__(self, pace: Pace, wire: ByteWire, config: LinkConfig, source: str) -> None:
        self.pace, self.clock, self.source = pace, pace.clock, source
        self.tap = Tap(wire, self.clock)
        self.target = (config.system, config.component)
        self.link = Px4Link(self.tap, config)
        self.notes: list[str] = []

    def step(self, command: Rates | None = None) -> LinkOutput:
        """Two milliseconds."""
        self.pace()
        output = self.link.step(self.clock.now_ns, command)
        self.notes += [note.text for note in output.notes if note.severity != "info"]
        return output

    def close(self) -> None:
        """Close the wire."""
        self.tap.close()


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
    """The autopilot at the rig's address. Raises Unavailable if the wire cannot be opened."""
    from hil.wires import WireError
    from hil.wires.url import open_url

    slot = rig.vehicle
    if slot.signing_key:
        raise Unavailable("a checklist cannot read an autopilot that requires signed MAVLink")
    try:
        wire = open_url(slot.url, slot.system)
    except WireError as error:
        raise Unavailable(str(error)) from None
    config = LinkConfig(
        start=_START,
        hover_thrust=airframe.hover_thrust,
        system=slot.system,
        component=slot.component,
        clock_drift=slot.clock_drift,
        arm=False,
    )
    return Bench(Wall(), wire, config, f"autopilot at {slot.url}")


def read_ground(bench: Bench) -> GroundReport:
    """Let the driver set its parameters and streams if it has not yet, then receive for two seconds.

    Raises Unavailable if it gets no answer. The vehicle is not armed.
    """
    began = bench.clock.now_ns
    bench.tap.drain()
    while bench.link.phase in ("connect", "parameters", "streams"):
        bench.step()
        if bench.link.phase == "failed" or bench.clock.now_ns - began > _ANSWER_LIMIT_NS:
            raise Unavailable(f"no working link to {bench.source}: {'; '.join(bench.notes[-2:]) or bench.link.phase}")
    since = bench.clock.now_ns
    fine = False
    while bench.clock.now_ns - since < (_RECEIVE_NS if fine else _HEALTH_LIMIT_NS):
        bench.step()
        status = bench.tap.received.get("SYS_STATUS")
        fine = bool(status and status[-1][1].onboard_control_sensors_health & px4.PREARM_CHECK)
    counters = bench.link.counters
    return GroundReport(
        received=bench.tap.received,
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
        self._bench, self._packer = bench, Packer(245, 190)

    def __missing__(self, name: str) -> float:
        bench = self._bench
        bench.tap.parameters.pop(name, None)
        request = READ.pack(-1, *bench.target, name.encode())
        for _ in range(3):
            bench.tap.send(self._packer.pack_payload(MESSAGES["PARAM_REQUEST_READ"], request))
            for _ in range(250):
                bench.step()
                if name in bench.tap.parameters:
                    self[name] = bench.tap.parameters[name]
                    return self[name]
        raise KeyError(name)
