"""Measures rate and age of motion capture's poses for one second."""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise

from hil.assembly.rig import MocapSlot, Rig
from hil.bench.reading import Unavailable
from hil.host.lockstep import Clock, Lockstep
from hil.nodes.mocap import MocapNode
from hil.nodes.vehicle import VehicleDevice
from hil.wires import WireError
from hil.wires.mocap_vrpn import VrpnMocap
from scenarios.draw import Drawn
from vehicle.mocap.system import Mocap
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import Airframe

_MS = 1_000_000
_RECEIVE_NS = 1_000_000_000


@dataclass(frozen=True)
class MocapReport:
    """Rate (Hz) and the greatest age (ms) of the newest pose at any moment, and the greatest gap between two (ms)."""

    rate_hz: float
    age_ms: float
    gap_ms: float
    source: str


def measure_mocap(rig: Rig, airframe: Airframe, drawn: Drawn) -> MocapReport:
    """Measure with the vehicle at rest. Raises Unavailable if nothing arrives."""
    if rig.mocap.kind == "vrpn":
        return _receive(rig.mocap)
    return _modelled(rig, airframe, drawn)


def _receive(slot: MocapSlot) -> MocapReport:
    poses_received: list[tuple[int, int]] = []
    try:
        wire = VrpnMocap(slot.server, (slot.vehicle_body, slot.board_body), round(slot.delay_ms * _MS))
        wire.wait_for_bodies()
    except WireError as error:
        raise Unavailable(str(error)) from None
    wire.take(0)  # poses that arrived during the wait
    began = time.monotonic_ns()
    while time.monotonic_ns() - began < _RECEIVE_NS:
        time.sleep(0.002)
        poses = wire.take(0)
        now = time.monotonic_ns() - began
        poses_received += [(now, now - pose.age_ns) for pose in poses if pose.body == slot.vehicle_body]
    wire.close()
    return _report(poses_received, f"VRPN from {slot.server}; {slot.delay_ms:g} ms of the age are the rig's setting")


def _modelled(rig: Rig, airframe: Airframe, drawn: Drawn) -> MocapReport:
    clock = Clock()
    device = VehicleDevice(Px4Sim({}, airframe, drawn.vehicle_seed))
    seed = drawn.mocap_seed
    node = MocapNode(Mocap(seed), Mocap(seed + 1), rig.mocap.rate_hz, round(rig.mocap.delay_ms * _MS))
    poses_received: list[tuple[int, int]] = []

    def tap(now_ns: int, topic: str, message: object) -> None:
        if topic == "mocap/vehicle":
            poses_received.append((now_ns, getattr(message, "stamp_ns")))  # noqa: B009

    Lockstep([device, node], clock, tap).run(lambda now: now >= _RECEIVE_NS)
    return _report(poses_received, "modelled motion capture")


def _report(poses_received: list[tuple[int, int]], source: str) -> MocapReport:
    """`poses_received`: arrival and time of each pose, ns."""
    if len(poses_received) < 2:
        raise Unavailable("motion capture sent nothing in a second")
    gaps = [b[0] - a[0] for a, b in pairwise(poses_received)]
    oldest = max(b[0] - a[1] for a, b in pairwise(poses_received))  # just before the next one arrived
    rate = (len(poses_received) - 1) * 1e9 / (poses_received[-1][0] - poses_received[0][0])
    return MocapReport(rate, oldest / _MS, max(gaps) / _MS, source)
