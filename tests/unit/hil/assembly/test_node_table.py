"""The table of nodes: every row builds the node that it names, and services follow from the rows."""

import pytest

from hil.assembly.builder import Assembly
from hil.assembly.node_table import NODES, SERVICES, driving_services, node_names, service_nodes
from hil.assembly.plan import Plan
from hil.assembly.rig import load_rig
from hil.assembly.simulation import MemoryWires
from hil.contract.node import Node
from scenarios.draw import draw

PLAN = Plan("simple-i", "sim", None, None)


@pytest.fixture(scope="module")
def assembly():
    wires = MemoryWires(PLAN.rig, lambda: 0)
    return Assembly(PLAN.scenario, PLAN.rig, draw(PLAN.scenario, 0), PLAN.make_policy, wires)


@pytest.mark.parametrize("name", NODES)
def test_table_row_builds_the_node_of_its_name(assembly, name):
    node = assembly.node(name)
    assert isinstance(node, Node)
    assert node.name == name
    node.close()


def test_nodes_step_in_the_order_of_the_rows():
    assert node_names(PLAN.rig) == (
        *("car_device", "vehicle_device", "mocap", "director", "referee", "car_follower", "car_link", "camera"),
        *("detector", "vehicle_link", "belief", "policy"),
    )


def test_device_services_start_first_and_the_safety_gate_has_its_own_process():
    services = service_nodes(PLAN.rig)
    assert list(services) == [
        *("vehicle_device", "car_device", "mocap", "vehicle_link", "car", "camera", "detector", "brain", "referee")
    ]
    assert services["vehicle_link"] == ("vehicle_link",)
    assert services["car"] == ("car_follower", "car_link")
    assert len({service.start_rank for service in SERVICES.values()}) == len(SERVICES)


def test_a_rig_with_real_devices_has_no_service_for_them():
    assert not {"vehicle_device", "car_device"} & set(service_nodes(load_rig("field")))


def test_the_services_that_drive_a_device_are_those_of_vehicle_and_car():
    assert driving_services() == ("vehicle_link", "car")


def test_node_without_a_slot_in_the_rig_is_refused(assembly):
    with pytest.raises(ValueError, match="no node 'lidar'; it has car_device"):
        assembly.node("lidar")
