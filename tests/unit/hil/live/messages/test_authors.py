"""Events belong to the service on whose key they came."""

import pytest

from hil.bus.mailbox import Delivery
from hil.contract.messages import Event, Stage
from hil.live.messages.authors import attributed


@pytest.mark.parametrize(
    ("author", "source", "own"),
    [
        ("referee", "director", True),
        ("referee", "referee", True),
        ("vehicle_link", "gate", True),
        ("car", "car_gate", True),
        ("car", "car_link", True),
        ("supervisor", "supervisor", True),
        ("brain", "director", False),
        ("brain", "gate", False),
        ("car_device", "car_gate", False),
        ("unnamed", "director", False),
        ("brain", "", False),
        ("brain", "x" * 10_000, False),
    ],
)
def test_event_keeps_a_source_that_is_its_authors_and_no_other(author, source, own):
    delivery = Delivery("event", 1, 2, Event(1, "error", source, "text"), author)
    found = attributed(delivery)
    if own:
        assert found is delivery
        return
    assert found.message.source == author
    assert found.message.text == f'(gave "{source[:40]}" as its name) text'
    assert (found.sequence, found.message.severity) == (2, "error")


def test_other_messages_are_not_changed():
    delivery = Delivery("run/stage", 1, 2, Stage(1, "lead", 0, 0))
    assert attributed(delivery) is delivery
