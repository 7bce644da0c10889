"""Stamps against now: which are of the future, and therefore broken. Times are int nanoseconds of one clock."""

from __future__ import annotations

# The clocks of an autopilot and of other hosts are known to a few milliseconds only.
CLOCK_ERROR_NS = 5_000_000


def later_than_now(stamp_ns: int, now_ns: int) -> bool:
    """Whether `stamp_ns` is later than `now_ns` by more than the error of a clock: its age must not be used."""
    return stamp_ns - now_ns > CLOCK_ERROR_NS
