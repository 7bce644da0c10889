"""Warming up: every kernel a process will need is compiled, or loaded from the cache, before it says that it is ready.

Throw-away copies of its nodes are stepped with plausible messages, on wires in memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from hil import messages as m
from hil.assembly import Assembly
from hil.node import Inbox, Node

_STEP_NS = 10_000_000
_STEPS = 60
_LEVEL = (1.0, 0.0, 0.0, 0.0)
_ZERO = (0.0, 0.0, 0.0)


def warm_up(assembly: Assembly, names: Iterable[str]) -> None:
    """Step fresh nodes `names` of `assembly` (whose wires must lead nowhere)."""
    names = list(names)
    image: m.Image | None = None
    if "detector" in names and "camera" in assembly.names:
        image = _picture(assembly.node("camera"))
    partners = {"vehicle_link": "vehicle_device", "car_link": "car_device"}
    together = [*names, *(partners[n] for n in names if partners.get(n) in assembly.names and partners[n] not in names)]
    nodes = [assembly.node(name) for name in assembly.names if name in together]
    samples = _samples(image)
    for step in range(_STEPS):
        for node in nodes:
            _feed(node, step * _STEP_NS, samples)
    for node in nodes:
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
    """By topic: a hovering vehicle that looks at a board 2.5 m ahead."""
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
        "belief": lambda t: m.Belief(t, True, place, 0.0, 0.0, 0.0, 2 * half, 1.0, t, 50, 0, (1e-4,) * 7, 0.0, 50),
    }
    if image is not None:
        picture = image
        found["camera/image"] = lambda t: m.Image(
            t, picture.width, picture.height, picture.exposure_ns, picture.data, t // _STEP_NS
        )
    return found
