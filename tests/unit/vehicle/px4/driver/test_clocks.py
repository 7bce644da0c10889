"""The driver's clocks: offset, PX4's time, reboots."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehicle.px4.driver.clocks import ClockOffset, LinkTime

MS, SECOND = 1_000_000, 1_000_000_000


@given(
    st.integers(-(10**18), 10**18),
    st.lists(st.tuples(st.integers(0, 40 * MS), st.integers(0, 40 * MS)), min_size=1, max_size=60),
)
def test_offset_error_is_at_most_half_the_best_round_trip(offset, trips):
    clock, now = ClockOffset(drift=0.0), 0
    for there, back in trips:
        now += 100 * MS
        clock.add(now, now + there + offset, now + there + back)
    assert clock.offset_ns is not None
    best = min(there + back for there, back in trips[-20:])
    assert abs(clock.offset_ns - offset) <= best // 2 + 1


@pytest.mark.parametrize("drift", [0.0, 0.01, -0.02])
def test_offset_follows_a_lagging_px4(drift):
    clock = ClockOffset(drift=0.03)
    worst = 0
    for i in range(400):
        now = i * 100 * MS
        trip = (2 + 7 * i % 9) * MS
        px4_ns = round((now + trip / 2) * (1.0 + drift))
        clock.add(now, px4_ns, now + trip)
        assert clock.offset_ns is not None
        worst = max(worst, abs(clock.offset_ns - (px4_ns - (now + trip // 2))))
    assert worst < 12 * MS  # 4 s of which would be 80 ms without following


def test_timesync_answers_without_a_request_are_counted():
    clock = ClockOffset()
    clock.add(5 * SECOND, 1, 4 * SECOND)
    clock.add(1 * SECOND, 1, 2 * SECOND)
    assert (clock.offset_ns, clock.rejected, clock.ours(5)) == (None, 2, None)


def test_known_clock_offset_is_kept():
    clock = ClockOffset(fixed_ns=-7)
    clock.add(0, 500, 10)
    clock.forget()
    assert (clock.offset_ns, clock.ours(3)) == (-7, 10)


def test_link_time_is_px4_time_or_host_time_without_stamps():
    time, now = LinkTime(), 0
    for _ in range(20):  # no stamp received: our time
        time.advance(now := now + 50 * MS)
    assert time.ns == 950 * MS
    for i in range(100):  # at a quarter of our speed
        time.receive(1000 * SECOND + i * 25 * MS)
        time.advance(now := now + 100 * MS)
    assert time.ns == pytest.approx((950 + 99 * 25) * MS, abs=101 * MS)
    before = time.ns
    for _ in range(30):  # silent: ours again after a second
        time.advance(now := now + 100 * MS)
    assert time.ns - before == 2000 * MS


def test_decreasing_px4_time_is_a_reboot():
    time = LinkTime()
    assert not time.receive(100 * SECOND)
    assert not time.receive(100 * SECOND - 400 * MS), "frames may overtake each other"
    assert time.receive(3 * SECOND)
    assert time.reboots == 1
