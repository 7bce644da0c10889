"""The recorder of a live run: when it ends, and in which order it writes."""

from hil.bus.mailbox import Delivery
from hil.live.recorder import SETTLE_NS, Ending, Sorter


def test_recorder_ordered_to_end_exits_without_a_supervisor():
    ending = Ending()
    ending.look(alone=True, now_s=10.0)
    ending.ask()
    ending.look(alone=True, now_s=10.5)  # a supervisor that ends its recorder is silent by then
    assert ending.due


def test_a_recorder_without_a_supervisor_waits_for_the_safe_state():
    ending = Ending()
    ending.look(alone=False, now_s=3.0)
    ending.look(alone=True, now_s=10.0)
    ending.look(alone=True, now_s=30.0)
    assert not ending.due
    ending.look(alone=True, now_s=33.0)
    assert ending.due


def test_messages_are_written_in_the_order_of_their_publication():
    sorter = Sorter()
    for at in (30, 10, 20):
        sorter.add(Delivery("event", at, at, None))
    assert sorter.take(SETTLE_NS + 5) == []
    assert [now for now, _ in sorter.take(SETTLE_NS + 20)] == [10, 20]
    sorter.add(Delivery("event", 15, 15, None))  # too late for its place
    assert [now for now, _ in sorter.take(None)] == [20, 30]
    assert sorter.late == 1
