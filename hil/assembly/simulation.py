"""All nodes of a simulated run in one process, on wires in memory or to a firmware in lockstep: what the lockstep host
drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hil.assembly.builder import Assembly
from hil.assembly.hitl import HitlWires, free_instance, idle_core, offboard_url
from hil.assembly.rig import Rig
from hil.contract.node import Node
from hil.contract.wire import memory_pair
from hil.wires import WireError
from hil.wires.barrier import BarrierWire
from hil.wires.settled import IdleCore, SettledWire
from hil.wires.url import open_url
from policies.task.interface import FlyingPolicy
from scenarios.draw import Drawn
from scenarios.spec import Scenario
from vehicle.camera.pinhole import Camera
from vehicle.px4.hitl.device import BASE_US

_MS = 1_000_000


class MemoryWires:
    """Both ends of both wires in memory, with the rig's delays by the host's clock (ns).

    A real firmware is a process: its wires leave this one. What is sent to it has been processed before `send` returns,
    and each of its steps is waited for, so that its clock is the host's."""

    def __init__(self, rig: Rig, clock: Callable[[], int]) -> None:
        self._slot, self._clock = rig.vehicle, clock
        self._vehicle = memory_pair(clock, round(rig.vehicle.wire_delay_ms * _MS))
        self._car = memory_pair(clock, round(rig.groundcar.wire_delay_ms * _MS))
        self._hitl: HitlWires | None = None
        self._offboard: BarrierWire | SettledWire | None = None
        self._core: IdleCore | None = None

    @cached_property
    def _instance(self) -> int:
        return free_instance(self._slot)

    def vehicle_system(self) -> int:
        return self._slot.system + self._instance

    def vehicle_link(self) -> object:
        if self._slot.kind != "hitl":
            return self._vehicle[0]
        url = offboard_url(self._slot, self._instance)
        core = self._idle_core()
        wire = open_url(url, self.vehicle_system())
        if core is None:
            self._offboard = BarrierWire(wire, lambda: BASE_US + self._clock() // 1000)
        else:
            self._offboard = SettledWire(wire, core)
        return self._offboard

    def vehicle_device(self) -> object:
        if self._slot.kind != "hitl":
            return self._vehicle[1]
        self._hitl = HitlWires(self._slot, self._instance, self._idle_core())
        return self._hitl.simulator

    def _idle_core(self) -> IdleCore | None:
        self._core = self._core or idle_core(self._slot)
        return self._core

    def start(self, folder: Path) -> None:
        """Start what runs outside this process; what it leaves goes into `folder`. Raises WireError."""
        if self._hitl is not None:
            self._hitl.start(folder)

    def close(self) -> None:
        """Close what leaves this process; may be called twice."""
        for wire in (self._offboard, self._hitl, self._core):
            if wire is not None:
                wire.close()

    def car_link(self) -> object:
        return self._car[0]

    def car_device(self) -> object:
        return self._car[1]


@dataclass
class Simulation:
    """The nodes, their wires, and what the host must know of them. `camera` is the calibrated one."""

    nodes: list[Node]
    camera: Camera
    wires: MemoryWires


def build(scenario: Scenario, rig: Rig, drawn: Drawn, policy: FlyingPolicy, clock: Callable[[], int]) -> Simulation:
    """Build every node. `clock` is the host's virtual time (ns), which memory wires deliver by.

    Raises WireError if a wire to a firmware cannot be opened. Raises ValueError, also for a rig with a real device:
    that keeps real time, which only the live host does.
    """
    if not rig.simulated:
        raise ValueError(f"rig {rig.title!r} has real devices, which keep real time: fly it with --live")
    wires = MemoryWires(rig, clock)
    assembly = Assembly(scenario, rig, drawn, lambda: policy, wires)
    try:
        nodes = [assembly.node(name) for name in assembly.names]
    except (WireError, ValueError):
        wires.close()
        raise
    return Simulation(nodes, assembly.camera, wires)


def counters(nodes: Sequence[Node]) -> dict[str, int]:
    """What these nodes rejected or dropped: description -> count."""
    return {description: count for node in nodes for description, count in node.counters.items()}
