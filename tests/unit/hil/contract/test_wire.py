from hypothesis import given
from hypothesis import strategies as st

from hil.contract.wire import CanFrame, memory_pair


class Time:
    def __init__(self):
        self.now = 0

    def __call__(self):
        return self.now


def test_wire_delivers_each_item_once_to_the_other_end():
    a, b = memory_pair(Time())
    a.send(b"one")
    a.send(b"two")
    assert a.receive() == [], "an end does not receive its own items"
    assert b.receive() == [b"one", b"two"]
    assert b.receive() == []


def test_directions_of_a_wire_are_independent():
    a, b = memory_pair(Time())
    a.send(b"to b")
    b.send(b"to a")
    assert (a.receive(), b.receive()) == ([b"to a"], [b"to b"])


def test_wire_carries_can_frames_unchanged():
    a, b = memory_pair(Time())
    a.send(CanFrame(0x111, b"\x00\x96"))
    assert b.receive() == [CanFrame(0x111, b"\x00\x96")]


def test_item_does_not_arrive_before_its_delay():
    clock = Time()
    a, b = memory_pair(clock, 1_000_000)
    a.send(b"x")
    clock.now = 999_999
    assert b.receive() == []
    clock.now = 1_000_000
    assert b.receive() == [b"x"]


def test_closed_wire_end_receives_nothing():
    a, b = memory_pair(Time())
    a.send(b"x")
    b.close()
    assert b.receive() == []


@given(st.lists(st.tuples(st.integers(0, 50), st.booleans()), max_size=60), st.integers(0, 40))
def test_items_arrive_once_in_order_and_not_before_their_delay(script, delay):
    """Any schedule of sends and looks: each item comes out once, in order, at its time or at the first look after."""
    clock = Time()
    a, b = memory_pair(clock, delay)
    sent, received = [], []
    for wait, send in script:
        clock.now += wait
        if send:
            a.send(item := (clock.now, len(sent)))
            sent.append(item)
        else:
            items = b.receive()
            assert all(then + delay <= clock.now for then, _ in items)
            received += items
            assert received == [item for item in sent if item[0] + delay <= clock.now]
    clock.now += delay
    assert received + b.receive() == sent
