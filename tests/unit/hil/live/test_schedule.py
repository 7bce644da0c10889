"""The order in which one process of a live run steps its nodes and publishes their outputs."""

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


def test_due_picture_is_published_before_the_next_is_drawn():
    clock, done = [0], []
    schedule = Schedule(
        [Slow(clock, done)], lambda _, message: done.append(("published", message.stamp_ns)) or 0, lambda: clock[0]
    )
    schedule.begin()
    schedule.catch_up()
    clock[0] = 12 * MS  # woken late: both are due
    schedule.catch_up()
    assert done == [("drawn", 0), ("published", 0), ("drawn", 10 * MS)]
    clock[0] = 19 * MS
    schedule.catch_up()
    assert done[-1] == ("published", 10 * MS)


def test_late_node_is_stepped_once_and_missed_deadlines_are_counted():
    clock, done = [0], []
    schedule = Schedule([Slow(clock, done)], lambda *_: 0, lambda: clock[0])
    schedule.begin()
    clock[0] = 47 * MS
    schedule.catch_up()
    assert done == [("drawn", 40 * MS)]
    ((_, pace),) = schedule.paces
    assert (pace.steps, pace.late, pace.missed) == (1, 1, 4)


def test_deadlines_begin_at_the_given_phase():
    clock, done = [0], []
    schedule = Schedule([Slow(clock, done)], lambda *_: 0, lambda: clock[0])
    schedule.begin(3 * MS)
    schedule.catch_up()
    assert done == []
    clock[0] = 13 * MS
    schedule.catch_up()
    assert done == [("drawn", 13 * MS)]
