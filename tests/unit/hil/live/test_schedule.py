"""The order in which one process of a live run steps its nodes and publishes what they said."""

from hil.contract import messages as m
from hil.contract.node import Node, Out
from hil.live.schedule import Schedule

MS = 1_000_000


class Slow(Node):
    """A camera of a 10 ms period whose pictures are due 9 ms after their step, which itself takes 4 ms."""

    name, inputs, outputs, wakes, period_ns = "camera", (), ("event",), (), 10 * MS

    def __init__(self, clock, done):
        self._clock, self._done = clock, done

    def step(self, now_ns, inbox):
        self._clock[0] += 4 * MS
        self._done.append(("drawn", now_ns))
        return [Out("event", m.Event(now_ns, "info", "camera", "picture"), 9 * MS)]


def test_a_picture_that_is_due_is_published_before_the_next_one_is_drawn():
    clock, done = [0], []
    seats = Schedule(
        [Slow(clock, done)], lambda _, message: done.append(("published", message.stamp_ns)) or 0, lambda: clock[0]
    )
    seats.begin()
    seats.catch_up()
    clock[0] = 12 * MS  # woken late: both are due
    seats.catch_up()
    assert done == [("drawn", 0), ("published", 0), ("drawn", 10 * MS)]
    clock[0] = 19 * MS
    seats.catch_up()
    assert done[-1] == ("published", 10 * MS)


def test_a_node_that_cannot_keep_its_period_is_stepped_once_and_missed_deadlines_are_counted():
    clock, done = [0], []
    seats = Schedule([Slow(clock, done)], lambda *_: 0, lambda: clock[0])
    seats.begin()
    clock[0] = 47 * MS
    seats.catch_up()
    assert done == [("drawn", 40 * MS)]
    ((_, pace),) = seats.paces
    assert (pace.steps, pace.late, pace.missed) == (1, 1, 4)


def test_deadlines_begin_at_the_given_phase():
    clock, done = [0], []
    seats = Schedule([Slow(clock, done)], lambda *_: 0, lambda: clock[0])
    seats.begin(3 * MS)
    seats.catch_up()
    assert done == []
    clock[0] = 13 * MS
    seats.catch_up()
    assert done == [("drawn", 13 * MS)]
