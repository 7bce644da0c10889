"""A Crazyflie on the bench, real or simulated: what it reports at rest and disarmed, and a trial flight of a simulated
one: its battery under load, and what it does when the radio is lost."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from hil.assembly.rig import Rig
from hil.bench.pace import Pace, Virtual, Wall
from hil.bench.reading import Unavailable
from hil.contract.wire import ByteWire, memory_pair
from hil.wires import WireError
from scenarios.draw import Drawn
from vehicle.crazyflie.driver.device import Status
from vehicle.crazyflie.driver.driver import CrazyflieLink
from vehicle.crazyflie.driver.types import CrazyflieConfig
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.crazyflie.sim.supervisor import State
from vehicle.px4.driver.arming import Identity
from vehicle.px4.driver.types import ExternalPose, LinkOutput, Rates
from vehicle.quadrotor.airframe import GRAVITY, Airframe

_MS = 1_000_000
_START = (0.0, 0.0, 1.2, 0.0)
_ANSWER_LIMIT_NS, _LISTEN_NS = 20_000 * _MS, 2_000 * _MS
_FLIGHT_LIMIT_NS, _LOSS_LIMIT_NS = 60_000 * _MS, 5_000 * _MS
_POSE_NS = 10 * _MS


@dataclass(frozen=True)
class CrazyflieReport:
    """What it reports on the ground, not armed. `odometry_hz`: of its state estimate."""

    status: Status
    identity: Identity
    parameters: dict[str, float]
    odometry_hz: float
    source: str


@dataclass(frozen=True)
class CrazyflieTrial:
    """Of a trial flight: V under the load of a hover; s from the loss of the radio until it flew level, and until its
    motors had stopped (None: they did not)."""

    hover_v: float
    level_s: float | None
    stop_s: float | None
    source: str = "software Crazyflie, flown to a hover for it"


class CrazyflieBench:
    """The driver on a wire; `pose` (now ns) is what motion capture sees of the vehicle, None for nothing new."""

    def __init__(
        self,
        pace: Pace,
        wire: ByteWire,
        mass: float,
        pose: Callable[[int], ExternalPose | None],
        source: str,
        arm: bool = False,
    ) -> None:
        self.pace, self.clock, self.source = pace, pace.clock, source
        self._wire, self._pose = wire, pose
        self.link = CrazyflieLink(wire, CrazyflieConfig(_START, mass, arm=arm))
        self.notes: list[str] = []

    def step(self, command: Rates | None = None) -> LinkOutput:
        """Two milliseconds."""
        self.pace()
        output = self.link.step(self.clock.now_ns, command, self._pose(self.clock.now_ns))
        self.notes += [note.text for note in output.notes if note.severity != "info"]
        return output

    def close(self) -> None:
        """Close the wire."""
        self._wire.close()


class _Cut:
    """A wire that may be cut."""

    def __init__(self, wire: ByteWire) -> None:
        self._wire, self.cut = wire, False

    def send(self, data: bytes) -> object:
        return False if self.cut else self._wire.send(data)

    def receive(self) -> list[bytes]:
        items = self._wire.receive()
        return [] if self.cut else items

    def close(self) -> None:
        self._wire.close()


class SimulatedCrazyflie(CrazyflieBench):
    """A software Crazyflie on a wire in memory, in virtual time, under motion capture."""

    def __init__(self, airframe: Airframe, rig: Rig, drawn: Drawn, *, arm: bool = False) -> None:
        pace = Virtual()
        ours, theirs = memory_pair(pace.clock, round(rig.vehicle.wire_delay_ms * _MS))
        self.sim = CrazyflieSim(theirs, airframe, drawn.vehicle_seed)
        self.wire = _Cut(ours)
        pace.devices.append(self.sim.step)
        super().__init__(pace, self.wire, airframe.body.mass, self._seen, "software Crazyflie, CRTP in memory", arm)

    def _seen(self, now_ns: int) -> ExternalPose | None:
        if now_ns % _POSE_NS:
            return None
        truth = self.sim.truth()
        return ExternalPose(now_ns, truth.position, truth.orientation)


def live_crazyflie(airframe: Airframe, rig: Rig) -> CrazyflieBench:
    """The Crazyflie at the rig's address, under the rig's motion capture. Raises Unavailable if either is not there."""
    from hil.wires.crazyradio import CrazyradioWire
    from hil.wires.mocap_vrpn import VrpnMocap

    slot = rig.mocap
    try:
        mocap = VrpnMocap(slot.server, (slot.vehicle_body,), round(slot.delay_ms * _MS)).wait_for_bodies()
        wire = CrazyradioWire(rig.vehicle.url)
    except WireError as error:
        raise Unavailable(str(error)) from None

    def seen(now_ns: int) -> ExternalPose | None:
        poses = mocap.take(now_ns)
        return ExternalPose(now_ns - poses[-1].age_ns, poses[-1].position, poses[-1].orientation) if poses else None

    return CrazyflieBench(Wall(), wire, airframe.body.mass, seen, f"Crazyflie at {rig.vehicle.url}")


def read_crazyflie(bench: CrazyflieBench) -> CrazyflieReport:
    """Connect if it has not yet, then listen for two seconds. Raises Unavailable if it gets no answer."""
    began = bench.clock.now_ns
    while bench.link.phase in ("connect", "parameters", "streams"):
        bench.step()
        if bench.link.phase == "failed" or bench.clock.now_ns - began > _ANSWER_LIMIT_NS:
            raise Unavailable(f"no working link to {bench.source}: {'; '.join(bench.notes[-2:]) or bench.link.phase}")
    since, count = bench.clock.now_ns, 0
    while bench.clock.now_ns - since < _LISTEN_NS:
        count += len(bench.step().odometry)
    status, identity = bench.link.status, bench.link.identity
    if status is None or identity is None:
        raise Unavailable(f"{bench.source} sends no log data")
    listened_s = (bench.clock.now_ns - since) * 1e-9
    return CrazyflieReport(status, identity, bench.link.parameters, count / listened_s, bench.source)


def try_crazyflie(airframe: Airframe, rig: Rig, drawn: Drawn) -> CrazyflieTrial:
    """Fly to a hover, hand over, lose the radio. Raises Unavailable if it does not reach the hover."""
    bench = SimulatedCrazyflie(airframe, rig, drawn, arm=True)
    while bench.link.phase not in ("hover", "failed") and bench.clock.now_ns < _FLIGHT_LIMIT_NS:
        bench.step()
    status = bench.link.status
    if bench.link.phase != "hover" or status is None:
        why = "; ".join(bench.notes[-2:]) or bench.link.phase
        raise Unavailable(f"the trial flight did not reach its hover: {why}")
    handed = bench.clock.now_ns
    while bench.clock.now_ns - handed < 300 * _MS:
        bench.step(Rates((0.0, 0.0, 0.0), GRAVITY) if bench.clock.now_ns % _POSE_NS == 0 else None)
    bench.wire.cut = True
    lost, level, stop = bench.clock.now_ns, None, None
    while stop is None and bench.clock.now_ns - lost < _LOSS_LIMIT_NS:
        bench.step()
        after = (bench.clock.now_ns - lost) * 1e-9
        if level is None and bench.sim.flight.supervisor.state == State.LEVEL_OUT:
            level = after
        if max(map(math.fabs, bench.sim.truth().motors)) < 0.02:
            stop = after
    return CrazyflieTrial(status.battery_v, level, stop)
