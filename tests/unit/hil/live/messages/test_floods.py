"""A flooded key is named with its publisher and its rate."""

import pytest

from hil.bus.leaf import CONTROL, EVENT, HEALTH, TOPIC, Bus, open_hub
from hil.contract import messages as m
from hil.live.messages.floods import Floods, flood_fault
from tests.unit.hil.bus.test_leaf import free_endpoint
from tests.unit.hil.live.test_service import until

OWNERS = {"brain": {"outputs": ["belief", "policy/action"]}, "camera": {"outputs": ["camera/image"]}}


@pytest.mark.parametrize(
    ("key", "count", "text"),
    [
        (TOPIC + "policy/action", 42_000, "brain floods policy/action (21000 messages a second, 100 are due)"),
        (TOPIC + "camera/image", 4000, "camera floods camera/image (2000 messages a second, 60 are due)"),
        (TOPIC + "belief", 1000, ""),
        (TOPIC + "mocap/board", 42_000, "an unknown service floods mocap/board (21000 messages a second, 100 are due)"),
        (EVENT + "mocap", 2000, "mocap floods event (1000 messages a second)"),
        (HEALTH + "car", 2000, "car floods its health (1000 messages a second)"),
        (CONTROL, 2000, "supervisor floods orders (1000 messages a second)"),
        ("perch/topic/../..", 2000, "an unknown service floods ../.. (1000 messages a second)"),
    ],
)
def test_flood_is_named_by_key_and_publisher(key, count, text):
    usual = {TOPIC + "truth/vehicle": 500, EVENT + "brain": 20, HEALTH + "brain": 4}
    assert flood_fault({**usual, key: count}, 2.0, OWNERS) == text


def test_worst_flood_is_named():
    counts = {TOPIC + "belief": 4000, EVENT + "mocap": 40_000}
    assert flood_fault(counts, 1.0, OWNERS).startswith("mocap floods event")


def test_messages_on_every_key_are_counted_once_asked_for():
    endpoint, event = free_endpoint(), m.Event(1, "info", "mocap", "text")
    with open_hub(endpoint), Bus(endpoint) as bus, Bus(endpoint, identity="mocap") as mocap:
        floods = Floods(bus, OWNERS)
        floods.count_all()
        assert floods.fault() == ""
        until(lambda: "mocap floods" in floods.fault(), lambda: [mocap.publish(1, "event", event) for _ in range(500)])
        assert floods.fault().startswith("mocap floods event (")
