"""Every node that a run can have, one row each. Hosts, services, priorities, warming up and replay go by this table.

A new node is a file in `hil/nodes/`, its builder, and a row here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

from hil.assembly import car, deciding, sensing, vehicle
from hil.assembly.parts import Parts
from hil.assembly.rig import Rig
from hil.contract.node import Node
from hil.faults.fault import FIRMWARE, Setting

PriorityClass = Literal["control", "detection", "off_path", "rendering", "recording"]


class Service(NamedTuple):
    """A process of a live run. Services are started by `start_rank` and stopped the other way round.

    `phase_ns`: where in its period of 4 or 10 ms it has its deadlines. They are not all at 0, where every process would
    need a core at once, and what reads motion capture comes after what publishes it.
    """

    name: str
    start_rank: int
    phase_ns: int
    priority: PriorityClass


class NodeRow(NamedTuple):
    """One node. `drives` and `simulates` name the slot of the rig whose wire the node has an end of, as the driver of
    the device or in the place of the device. `measures`: with this rig it publishes what a device measures, which does
    not follow from its inputs. `present`: whether this rig has it."""

    name: str
    service: Service
    build: Callable[[Parts], Node]
    drives: Literal["", "vehicle", "groundcar"] = ""
    simulates: Literal["", "vehicle", "groundcar"] = ""
    measures: Callable[[Rig], bool] = lambda _: False
    present: Callable[[Rig], bool] = lambda _: True

    @property
    def slot(self) -> str:
        """The slot whose wire it has an end of; empty for a node without a wire."""
        return self.drives or self.simulates


# Services of several nodes. Belief and policy run one after the other 100 times a second and nothing comes between
# them; so do follower and driver of the car. The vehicle's driver and gate are alone in a process: whatever happens to
# another process, the last check stands.
_CAR = Service("car", 5, 3_000_000, "off_path")
_BRAIN = Service("brain", 8, 0, "control")
_REFEREE = Service("referee", 9, 7_000_000, "off_path")

# In the order in which they act within one instant.
_ROWS = (
    NodeRow(
        "car_device", Service("car_device", 2, 2_000_000, "off_path"), car.car_device,
        simulates="groundcar", present=lambda rig: rig.groundcar.kind == "sim",
    ),
    NodeRow(
        "vehicle_device", Service("vehicle_device", 1, 0, "control"), vehicle.vehicle_device,
        simulates="vehicle", present=lambda rig: rig.vehicle.ours,
    ),
    NodeRow(
        "mocap", Service("mocap", 3, 1_000_000, "off_path"), sensing.mocap,
        measures=lambda rig: rig.mocap.kind != "sim",
    ),
    NodeRow("director", _REFEREE, deciding.director),
    NodeRow("referee", _REFEREE, deciding.referee),
    NodeRow("car_follower", _CAR, car.car_follower),
    NodeRow("car_link", _CAR, car.car_link, drives="groundcar"),
    NodeRow(
        "camera", Service("camera", 6, 0, "rendering"), sensing.camera,
        measures=lambda rig: rig.camera.kind != "sim", present=lambda rig: rig.policy.knows == "camera",
    ),
    NodeRow(
        "detector", Service("detector", 7, 0, "detection"), sensing.detector,
        present=lambda rig: rig.camera.source == "pictures" and rig.policy.knows == "camera",
    ),
    NodeRow("vehicle_link", Service("vehicle_link", 4, 5_000_000, "control"), vehicle.vehicle_link, drives="vehicle"),
    NodeRow("belief", _BRAIN, deciding.belief),
    NodeRow("policy", _BRAIN, deciding.policy),
)  # fmt: skip

NODES: dict[str, NodeRow] = {row.name: row for row in _ROWS}
SERVICES: dict[str, Service] = {
    service.name: service for service in sorted({row.service for row in _ROWS}, key=lambda s: s.start_rank)
}


def node_names(rig: Rig) -> tuple[str, ...]:
    """The nodes of a run with `rig`, in the order in which they act within one instant."""
    return tuple(row.name for row in _ROWS if row.present(rig))


def service_nodes(rig: Rig) -> dict[str, tuple[str, ...]]:
    """service -> its nodes in a run with `rig`, in the order of starting; services without a node are left out."""
    rows = [NODES[name] for name in node_names(rig)]
    found = {name: tuple(row.name for row in rows if row.service.name == name) for name in SERVICES}
    return {service: nodes for service, nodes in found.items() if nodes}


def driving_services() -> tuple[str, ...]:
    """The services that drive a device, and have to reach its safe state before a run may end."""
    drivers = {row.service.name for row in _ROWS if row.drives}
    return tuple(name for name in SERVICES if name in drivers)


def fault_setting(rig: Rig, *, live: bool) -> Setting:
    """What the kinds of faults must know of a run with `rig`."""
    slots = ("vehicle", "groundcar", "camera", "mocap")
    simulated = [slot for slot in slots if getattr(rig, slot).kind in ("sim", "crazyflie-sim")]
    simulated += [FIRMWARE] if rig.vehicle.kind == "hitl" else []
    return Setting(service_nodes(rig), simulated, rig.camera.source == "pictures", live)
