"""Orders to a service: malformed ones are ignored, after the go those of a second supervisor too."""

import pytest

from hil.live.messages.orders import Orders

GO = {"order": "go", "epoch_ns": 5, "session": "s"}


@pytest.mark.parametrize(
    "table",
    [
        {}, {"order": None}, {"order": 1}, {"order": "goo"}, {"order": ["go"]}, {"order": "go"},
        {"order": "go", "epoch_ns": None}, {"order": "go", "epoch_ns": "5"}, {"order": "go", "epoch_ns": 1e999},
        {"order": "go", "epoch_ns": 5.0}, {"order": "go", "epoch_ns": 2**80}, {"order": "go", "epoch_ns": [5]},
    ],
)  # fmt: skip
def test_malformed_order_is_ignored(table):
    orders = Orders("brain", "01")
    assert not orders.put(table)
    assert orders.take() == []
    assert orders.put(GO)


def test_orders_are_taken_once_and_only_by_their_service():
    orders = Orders("brain", "01")
    stop = {"order": "stop", "service": "brain"}
    assert orders.put({"order": "watch"})
    assert orders.put({"order": "stop", "service": "camera"})
    assert orders.put(stop)
    assert (orders.take(), orders.take()) == ([stop], [])


def test_supervisor_that_gave_the_go_is_the_only_one():
    orders = Orders("brain", "01")
    assert orders.put({"order": "watch", "session": "other"})
    assert orders.put(GO)
    assert not orders.put({"order": "abort", "session": "other"})
    assert not orders.put({"order": "watch", "session": "other"})
    assert "of a second supervisor was not obeyed" in orders.refused
    assert orders.put({"order": "abort", "why": "", "session": "s"})
    assert [order["order"] for order in orders.take()] == ["go", "abort"]


@pytest.mark.parametrize(
    ("sessions", "displaced"),
    [({"brain": "01"}, False), ({"brain": "02"}, True), ({"camera": "02"}, False), (None, False), ([1], False)],
)
def test_go_names_the_process_that_serves(sessions, displaced):
    text = Orders("brain", "01").displaced({**GO, "sessions": sessions})
    assert bool(text) == displaced
