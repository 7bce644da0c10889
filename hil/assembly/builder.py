"""Scenario + rig + drawn numbers -> any one node of a run. Every node can be built by itself, in a process of its own:
nothing is shared between two of them but the wires, which belong to the host.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hil.assembly.node_table import NODES, fault_setting, node_names
from hil.assembly.parts import Parts, Wires
from hil.assembly.rig import Rig
from hil.assembly.sensing import mounted_cameras
from hil.contract.node import Node
from hil.faults.kinds import with_faults
from policies.task.interface import FlyingPolicy
from scenarios.draw import Drawn
from scenarios.spec import Scenario


class Assembly:
    """Builds the nodes of one run. The arguments are those of `Parts`."""

    def __init__(
        self,
        scenario: Scenario,
        rig: Rig,
        drawn: Drawn,
        make_policy: Callable[[], FlyingPolicy],
        wires: Wires,
        stopwatch: Callable[[], int] | None = None,
        unix_ns: int = 0,
    ) -> None:
        self._parts = Parts(scenario, rig, drawn, make_policy, wires, stopwatch, unix_ns)
        self.camera = mounted_cameras(rig.camera, self._parts.frame, drawn)[1]
        """The calibrated camera."""

    @property
    def names(self) -> tuple[str, ...]:
        """The run's nodes, in the order in which they act within one instant."""
        return node_names(self._parts.rig)

    def node(self, name: str) -> Node:
        """A fresh node of that name, with the scenario's faults around it. Raises ValueError if this rig has none, and
        what its builder raises."""
        if name not in self.names:
            raise ValueError(f"this rig has no node {name!r}; it has {', '.join(self.names)}")
        parts = self._parts
        return with_faults(
            name, lambda wires: NODES[name].build(replace(parts, wires=wires)), parts.wires, parts.scenario.fault,
            fault_setting(parts.rig, live=bool(parts.unix_ns)), (parts.drawn.seed, parts.scenario.name),
        )  # fmt: skip
