from hypothesis import given
from hypothesis import strategies as st

from hil.contract.wire import CanFrame, memory_pair


class Time:
    def __init__(self):
        self.now = 0

    def __call__(self):
        return self.now


def test_what_one_end_sends_the_other_receives_once():
    a, b = memory_pair(Time())
    a.send(b"one")
    a.send(b"two")
    assert a.receive() == [], "an end does not hear itself"
    assert b.receive() == [b"one", b"two"]
    assert b.receive() == []


def test_both_directions_are_apart():
    a, b = memory_pair(Time())
    a.send(b"to b")
    b.send(b"to a")
    assert (a.receive(), b.receive()) == ([b"to a"], [b"to b"])


def test_it_carries_can_frames_as_they_are():
    a, b = memory_pair(Time())
    a.send(CanFrame(0x111, b"\x00\x96"))
    assert b.receive() == [CanFrame(0x111, b"\x00\x96")]


def test_nothing_arrives_before_its_delay():
    clock = Time()
    a, b = memory_pair(clock, 1_000_000)
    a.send(b"x")
    clock.now = 999_999
    assert b.receive() == []
    clock.now = 1_000_000
    assert b.receive() == [b"x"]


def test_a_closed_end_has_nothing_more():
    a, b = memory_pair(Time())
    a.send(b"x")
    b.close()
    assert b.receive() == []


@given(st.lists(st.tuples(st.integers(0, 50), st.booleans()), max_size=60), st.integers(0, 40))
def test_everything_arrives_once_in_order_and_never_early(script, delay):
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
