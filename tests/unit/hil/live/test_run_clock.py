"""The run's time on another host: translated by the measured offset, corrected slowly, reported in words."""

from itertools import pairwise

from hil.bus.clock import Clock
from hil.live.run_clock import ERROR_LIMIT_NS, RunTime, clock_fault, clock_lines

SECOND = 1_000_000_000


class Watch:
    """Stands for a `ClockWatch` with one reading."""

    def __init__(self, offset_ns, *, error_ns=200_000, date_ns=0, shared=False):
        self.best = Clock(offset_ns, error_ns, date_ns, shared)
        self.first, self.asked = self.best, 0

    def measure(self):
        return self.best

    def ask(self):
        self.asked += 1

    @property
    def moved_ns(self):
        return self.best.offset_ns - self.first.offset_ns


def test_run_starts_at_the_epoch_on_the_clock_of_the_hub():
    now = [5 * SECOND]
    run_time = RunTime(Watch(100 * SECOND), clock=lambda: now[0])
    assert not run_time.begun
    run_time.begin(105 * SECOND)
    assert run_time.begun
    assert run_time.now() == 0
    now[0] += 7
    assert run_time.now() == 7


def test_clock_drift_is_corrected_in_small_steps():
    watch = Watch(100 * SECOND)
    run_time = RunTime(watch, clock=lambda: 0)
    run_time.begin(0)
    watch.best = watch.best._replace(offset_ns=100 * SECOND + 250_000)
    seen = [run_time.now()]
    for _ in range(4):
        run_time.tick()
        seen.append(run_time.now())
    steps = [after - before for before, after in pairwise(seen)]
    assert steps == [100_000, 100_000, 50_000, 0]
    assert watch.asked == 4


def test_shared_clock_is_not_measured_again():
    watch = Watch(0, shared=True)
    RunTime(watch, clock=lambda: 0).tick()
    assert watch.asked == 0


def table(watch):
    return RunTime(watch, clock=lambda: 0).table()


def test_clock_offset_is_reported_relative_to_the_hub():
    (line,) = clock_lines("brain", table(Watch(-1234 * SECOND)))
    assert line.startswith("brain: on another host; its clock is +1234.000000 s from the hub's, known to 0.200 ms")
    assert clock_lines("brain", table(Watch(0, shared=True))) == []
    assert clock_lines("recorder", {}) == []


def test_wrong_date_and_fast_drift_are_reported():
    assert "set both by NTP" in clock_lines("brain", table(Watch(0, date_ns=-4 * SECOND)))[1]
    watch = Watch(0)
    run_time = RunTime(watch, clock=lambda: 0)
    watch.best = watch.best._replace(offset_ns=8_000_000)
    assert "drifted far apart" in clock_lines("brain", run_time.table())[1]


def test_run_is_refused_when_the_clock_offset_error_is_too_large():
    assert clock_fault("brain", table(Watch(0, error_ns=ERROR_LIMIT_NS))) == ""
    assert "only to within 5.0 ms" in clock_fault("brain", table(Watch(0, error_ns=ERROR_LIMIT_NS + 1)))
    assert clock_fault("brain", table(Watch(0, error_ns=ERROR_LIMIT_NS + 1, shared=True))) == ""
    assert clock_fault("brain", {}) == ""
