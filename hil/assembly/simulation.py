"""All nodes of a simulated run in one process, on wires in memory: what the lockstep host drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hil.assembly.builder import Assembly
from hil.assembly.rig import Rig
from hil.contract.node import Node
from hil.contract.wire import memory_pair
from hil.nodes.camera_device import CameraDevice
from hil.nodes.car import CarLink
from hil.nodes.detector import Detector
from hil.nodes.director import Director
from hil.nodes.mocap_device import MocapDevice
from hil.nodes.vehicle import VehicleLink
from policies.task.interface import FlyingPolicy
from scenarios.draw import Drawn
from scenarios.spec import Scenario
from vehicle.camera.pinhole import Camera

_MS = 1_000_000


@dataclass
class Simulation:
    """The nodes and what the host must know of them. `camera` is the calibrated one."""

    nodes: list[Node]
    director: Director
    camera: Camera
    counters: Callable[[], dict[str, int]]


class MemoryWires:
    """Both ends of both wires in memory, with the rig's delays by the host's clock (ns)."""

    def __init__(self, rig: Rig, clock: Callable[[], int]) -> None:
        self._vehicle = memory_pair(clock, round(rig.vehicle.wire_delay_ms * _MS))
        self._car = memory_pair(clock, round(rig.groundcar.wire_delay_ms * _MS))

    def vehicle_link(self) -> object:
        return self._vehicle[0]

    def vehicle_device(self) -> object:
        return self._vehicle[1]

    def car_link(self) -> object:
        return self._car[0]

    def car_device(self) -> object:
        return self._car[1]


def build(scenario: Scenario, rig: Rig, drawn: Drawn, policy: FlyingPolicy, clock: Callable[[], int]) -> Simulation:
    """Build every node. `clock` is the host's virtual time (ns), which memory wires deliver by.

    Raises ValueError, also for a rig with a real device: real devices keep real time, which only the live host does.
    """
    if not rig.simulated:
        raise ValueError(f"rig {rig.title!r} has real devices, which keep real time: fly it with --live")
    assembly = Assembly(scenario, rig, drawn, lambda: policy, MemoryWires(rig, clock))
    nodes = [assembly.node(name) for name in assembly.names]
    director = next(node for node in nodes if isinstance(node, Director))
    return Simulation(nodes, director, assembly.camera, lambda: counters(nodes))


def counters(nodes: Sequence[Node]) -> dict[str, int]:
    """What these nodes rejected or dropped, in words."""
    counts: dict[str, int] = {}
    for node in nodes:
        if isinstance(node, VehicleLink):
            counts["bytes of garbage on the vehicle's wire"] = node.garbage
            counts["commands too old to send"] = node.refused
        elif isinstance(node, CarLink):
            counts["frames rejected on the car's wire"] = node.rejected
            counts["commands too old to send to the car"] = node.refused
        elif isinstance(node, CameraDevice):
            counts["pictures replaced before they were read"] = node.dropped
            counts["cameras lost"] = node.losses
        elif isinstance(node, MocapDevice):
            counts["poses of motion capture rejected"] = node.rejected
            counts["times a body was hidden from motion capture"] = node.hidings
            counts["motion capture systems lost"] = node.losses
        elif isinstance(node, Detector):
            counts["pictures dropped by a busy detector"] = node.dropped
    counts.setdefault("pictures dropped by a busy detector", 0)
    return counts
