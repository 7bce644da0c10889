"""Compiles, or loads from the cache, every kernel that a process needs before the process reports ready.

Copies of its nodes are stepped on wires in memory through a flight from take-off to touchdown: each phase has kernels
of its own, and the first call of one takes many control periods.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from hil.assembly.builder import Assembly
from hil.assembly.node_table import NODES
from hil.assembly.plan import Plan
from hil.assembly.simulation import MemoryWires
from hil.assembly.twin import simulated_twin
from hil.contract import messages as m
from hil.contract.node import Inbox, Node
from hil.host.lockstep import Clock
from scenarios.draw import Drawn

_STEP_NS = 10_000_000
_STEPS = 60
_REHEARSAL_NS = 40_000_000_000
_LEVEL = (1.0, 0.0, 0.0, 0.0)
_ZERO = (0.0, 0.0, 0.0)
_G = 9.81


def warm_up(plan: Plan, drawn: Drawn, names: Sequence[str]) -> None:
    """Step fresh nodes `names` of the run, with every device simulated."""
    clock, rig = Clock(), simulated_twin(plan.rig)
    assembly = Assembly(plan.scenario, rig, drawn, plan.make_policy, MemoryWires(rig, clock))
    slots = {NODES[name].slot for name in names} - {""}
    if "vehicle" in slots:
        _rehearse(assembly, clock)
    image: m.Image | None = None
    if "detector" in names:
        image = _picture(assembly.node("camera"))
    # A driver and its simulated device are stepped together; the vehicle's have flown already.
    rows = [NODES[name] for name in assembly.names if name in names or NODES[name].slot in slots]
    nodes = [assembly.node(row.name) for row in rows if row.slot != "vehicle"]
    samples, began_ns = _samples(image), clock.now_ns
    for step in range(_STEPS):
        clock.now_ns = began_ns + step * _STEP_NS
        for node in nodes:
            _feed(node, step * _STEP_NS, samples)
    for node in nodes:
        node.close()


def _rehearse(assembly: Assembly, clock: Clock) -> None:
    """Take off, hover, fly on commands, make contact and stop the motors, in virtual time."""
    link, device = assembly.node("vehicle_link"), assembly.node("vehicle_device")
    inboxes, samples, left = {node: Inbox(node.inputs) for node in (device, link)}, _samples(None), -1
    while clock.now_ns < _REHEARSAL_NS and left:
        clock.now_ns += _STEP_NS
        if left > _STEPS // 2:
            action = m.Action(clock.now_ns, True, _ZERO, _G + 1e-3 * left, "warm-up", clock.now_ns, _G)
            inboxes[link].put("policy/action", action)
        elif left > 0:
            inboxes[device].put("truth/board", samples["truth/board"](clock.now_ns))
            for inbox in inboxes.values():
                inbox.put("referee/contact", m.Contact(clock.now_ns, "contact", "", True, True, 0, 0, 0, 0, 0))
        for node, inbox in inboxes.items():
            outs = node.step(clock.now_ns, inbox)
            inbox.clear()
            if left < 0 and any(out.topic == "vehicle/status" and out.message.phase == "hover" for out in outs):
                left = _STEPS
        left -= left > 0
    for node in inboxes:
        node.close()


def _feed(node: Node, now_ns: int, samples: dict[str, Callable[[int], Any]]) -> list[Any]:
    inbox = Inbox(node.inputs)
    for topic in node.inputs:
        if topic in samples:
            inbox.put(topic, samples[topic](now_ns))
    return node.step(now_ns, inbox)


def _picture(camera: Node) -> m.Image | None:
    outs = _feed(camera, 0, _samples(None))
    return outs[0].message if outs and isinstance(outs[0].message, m.Image) else None


def _samples(image: m.Image | None) -> dict[str, Callable[[int], Any]]:
    """By topic: a hovering vehicle with a board 2.5 m ahead in its camera's view."""
    half = math.radians(15.0)
    tilted = (math.cos(half), 0.0, -math.sin(half), 0.0)
    place = (2.5, 0.0, 1.5)

    def vehicle(t: int) -> m.VehicleState:
        return m.VehicleState(t, (0.0, 0.0, 2.0), _ZERO, _LEVEL, _ZERO)

    def board(t: int) -> m.BoardState:
        return m.BoardState(t, place, _ZERO, tilted, 0.0, 0.0, 0.0)

    found: dict[str, Callable[[int], Any]] = {
        "truth/vehicle": vehicle,
        "mocap/vehicle": vehicle,
        "vehicle/odometry": vehicle,
        "truth/board": board,
        "mocap/board": board,
        "run/stage": lambda t: m.Stage(t, "attempt", 1, 1),
        "board/detection": lambda t: m.Detection(
            t, True, place, tilted, 0.02, 0.02, (0,), (0.0,) * 8, "", t // _STEP_NS, 1
        ),
        "belief": lambda t: m.Belief(
            t, True, place, 0.0, 0.0, 0.0, 2 * half, 1.0, t, 50, 0, (1e-4,) * 7, 0.0, 50, 1e-3
        ),
    }
    if image is not None:
        picture = image
        found["camera/image"] = lambda t: m.Image(
            t, picture.width, picture.height, picture.exposure_ns, picture.data, t // _STEP_NS
        )
    return found
