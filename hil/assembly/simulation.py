"""All nodes of a simulated run in one process, on wires in memory: what the lockstep host drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hil.assembly.builder import Assembly
from hil.assembly.rig import Rig
from hil.contract.node import Node
from hil.contract.wire import memory_pair
from policies.task.interface import FlyingPolicy
from scenarios.draw import Drawn
from scenarios.spec import Scenario
from vehicle.camera.pinhole import Camera

_MS = 1_000_000


@dataclass
class Simulation:
    """The nodes and what the host must know of them. `camera` is the calibrated one."""

    nodes: list[Node]
    camera: Camera


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
    return Simulation(nodes, assembly.camera)


def counters(nodes: Sequence[Node]) -> dict[str, int]:
    """What these nodes rejected or dropped: description -> count."""
    return {description: count for node in nodes for description, count in node.counters.items()}
