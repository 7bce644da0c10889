"""Odometry is stamped on our clock when it was true, however slowly PX4's own clock runs."""

import pytest

from tests.unit.vehicle.px4.driver.driver_bench import MS, Bench
from vehicle.px4.driver.autopilot import Autopilot
from vehicle.px4.driver.clocks import ClockOffset
from vehicle.px4.driver.types import Rates


@pytest.mark.parametrize(("pace", "worst_ms"), [(0.9, 12.0), (0.97, 5.0), (1.0, 0.01)])
def test_stamps_stay_right_when_px4_runs_slower_than_our_clock(pace, worst_ms, monkeypatch):
    """A SITL that lags loses a tenth of a second each second at pace 0.9. The driver has no report of it."""
    bench, errors = Bench(), []
    real, original = bench.sim.step, Autopilot._odometry
    bench.sim.step = lambda now: real(bench.begin + int((now - bench.begin) * pace))

    def record_odometry(autopilot, fields, now_ns):
        known = len(autopilot.fresh)
        original(autopilot, fields, now_ns)
        if len(autopilot.fresh) > known:
            errors.append(autopilot.fresh[-1].stamp_ns - (bench.begin + fields.time_usec * 1000 / pace))

    monkeypatch.setattr(Autopilot, "_odometry", record_odometry)
    bench = bench.relink().to("hover", limit=60.0)
    errors.clear()
    bench.run(3.0, lambda _: Rates((0.0, 0.0, 0.0), 9.80665))
    assert bench.link.phase == "handed_over"
    assert len(errors) > 250
    assert max(map(abs, errors)) < worst_ms * MS


@pytest.mark.parametrize("pace", [0.5, 0.9, 0.99, 1.02])
def test_drift_is_estimated_from_answers(pace):
    clock, worst = ClockOffset(drift=1e-4), 0.0
    for i in range(300):
        now = i * 100 * MS
        trip = (2 + 7 * i % 9) * MS
        clock.add(now, round((now + trip / 2) * pace), now + trip)
        if i > 20:
            later = now + trip + 50 * MS
            ours = clock.ours(round(later * pace))
            assert ours is not None
            worst = max(worst, abs(ours - later) / MS)
    assert worst < 2.0 + 160.0 * abs(pace - 1.0) + 4.0, "the drift since the last answer, and half a round trip"


def test_jitter_alone_is_not_taken_for_drift():
    """Trips of 2 to 60 ms, all of the delay on one side: the shortest answers hold for the whole window."""
    clock = ClockOffset(drift=1e-4)
    for i in range(200):
        now, trip = i * 100 * MS, (2 if i % 10 == 0 else 60) * MS
        clock.add(now, now + trip, now + trip)
        assert clock.offset_ns is not None
        assert abs(clock.offset_ns) <= 1 * MS


def test_one_answer_hours_off_is_rejected_and_three_that_agree_are_accepted():
    clock, hour = ClockOffset(), 3_600_000 * MS

    def answer(k, off):
        clock.add(k * 100 * MS, k * 100 * MS + MS + off, k * 100 * MS + 2 * MS)
        return clock.offset_ns

    assert [answer(k, 0) for k in range(3)] == [0, 0, 0]
    assert answer(3, hour) == 0
    assert answer(4, 0) == 0
    assert clock.rejected == 1
    assert [answer(k, hour) for k in (5, 6, 7)] == [0, 0, hour]


def test_odometry_stamped_later_than_now_is_not_used():
    bench = Bench().to("hover", limit=60.0)
    autopilot = bench.link._autopilot
    bad = autopilot.bad_odometry
    real = autopilot.clock.ours
    autopilot.clock.ours = lambda px4_ns: real(px4_ns) + 3_600_000 * MS
    before = autopilot.odometry
    bench.run(0.1)
    assert autopilot.odometry is before
    assert autopilot.bad_odometry > bad
