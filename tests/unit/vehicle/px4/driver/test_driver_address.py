"""The autopilot is addressed by its MAVLink system and component."""

import pytest

from hil.contract.wire import memory_pair
from tests.unit.vehicle.px4.driver.driver_bench import START
from vehicle.px4.codec import Packer, Parser
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig


def test_autopilot_with_another_system_and_component_is_flown():
    """PX4 instance 2 (MAV_SYS_ID 3) with a component of its own: every frame goes to and comes from 3/7."""
    wire, device = memory_pair(lambda: 0)
    link = Px4Link(wire, LinkConfig(start=START, system=3, component=7))
    packer = Packer(3, 7)
    device.send(packer.send_name("HEARTBEAT", 2, 12, 0, 0, 3, 3))
    parser, asked = Parser(), []
    for step in range(5):
        link.step(step * 20_000_000)
        asked += [frame for data in device.receive() for frame in parser.feed(data)]
    targets = {(f.fields.target_system, f.fields.target_component) for f in asked if f.name == "PARAM_REQUEST_READ"}
    assert link.phase == "parameters"
    assert targets == {(3, 7)}


@pytest.mark.parametrize("component", [0, 256])
def test_component_out_of_range_raises(component):
    with pytest.raises(ValueError, match="MAVLink component"):
        LinkConfig(start=START, component=component)
