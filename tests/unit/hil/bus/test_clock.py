"""Comparing clocks: the truth is within the stated error, the shortest round trip is used, date steps are reported."""

import struct

import hypothesis.strategies as st
import pytest
from hypothesis import given

from hil.bus.clock import STEP_NS, ClockWatch, DateWatch, clock_id, compare

SECOND = 1_000_000_000
TRIP = st.integers(0, SECOND)


@given(st.integers(-(10**15), 10**15), st.integers(-(10**9), 10**9), st.integers(0, 10**15), TRIP, TRIP)
def test_clock_offset_error_bound_holds_for_unequal_transport_delays(offset, date_offset, began, there, back):
    theirs, date = began + there + offset, 10**18
    clock = compare(began, began + there + back, theirs, began + there + date + date_offset, date, False)
    assert abs(clock.offset_ns - offset) <= clock.error_ns + 1
    assert abs(clock.date_ns - date_offset) <= clock.error_ns + 1
    assert clock.error_ns <= (there + back + 1) // 2


def test_shared_clock_has_zero_offset_for_any_measurement():
    assert compare(0, 10, 400, 400, 0, True).offset_ns == 0


def test_clock_id_is_constant_within_a_process():
    assert clock_id() == clock_id() != b""


class Clocks:
    def __init__(self):
        self.monotonic_ns, self.date_ns = 0, 10**18

    def run(self, ns):
        self.monotonic_ns += ns
        self.date_ns += ns


def watched():
    clocks = Clocks()
    return clocks, DateWatch(lambda: clocks.date_ns, lambda: clocks.monotonic_ns)


def test_date_step_is_reported_once_with_its_size():
    clocks, watch = watched()
    clocks.run(SECOND)
    assert watch.text() == ""
    clocks.date_ns += 3 * SECOND
    assert watch.text().startswith("the date was set forward by 3.000 s: the run goes by the monotonic clock")
    assert watch.text() == ""
    clocks.date_ns -= 2 * SECOND
    assert watch.text().startswith("the date was set back by 2.000 s")
    assert watch.steps == 2


@given(st.lists(st.integers(-STEP_NS + 1, STEP_NS - 1), max_size=20))
def test_slewing_clock_is_not_reported_as_a_step(slews):
    clocks, watch = watched()
    for slew in slews:
        clocks.run(SECOND)
        clocks.date_ns += slew
        assert watch.text() == ""


class Hub:
    """A session whose hub accepts connections before it answers clock requests."""

    class Reply:
        class ok:
            class payload:
                @staticmethod
                def to_bytes():
                    return struct.pack("<qq", 5, 7)

            class attachment:
                @staticmethod
                def to_bytes():
                    return clock_id()

    def __init__(self, silent):
        self.asked, self._silent = 0, silent

    def get(self, *_, **__):
        self.asked += 1
        return [] if self.asked <= self._silent else [self.Reply]


def test_clock_request_is_repeated_until_the_hub_answers():
    hub = Hub(silent=3)
    assert ClockWatch(hub).measure(tries=4).shared
    assert hub.asked == 3 + 4


def test_clock_measurement_fails_when_the_hub_never_answers():
    with pytest.raises(TimeoutError, match="does not answer for its clock"):
        ClockWatch(Hub(silent=10**6)).measure(limit_s=0.2)
