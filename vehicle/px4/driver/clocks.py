"""The driver's two ideas of time: our clock against PX4's (TIMESYNC), and the time that timeouts are measured in."""

from __future__ import annotations

from collections import deque

_LONGEST_TRIP_NS = 500_000_000


class ClockOffset:
    """Keeps `offset_ns` = PX4 time - our time, from the TIMESYNC answer that bounds it best.

    An answer is off by no more than half its round trip when it comes, and by the drift of the clocks from then on.
    The drift is at least what two answers prove whose bounds contradict each other: a simulated PX4 lags as it likes.
    """

    def __init__(self, drift: float = 1e-4, fixed_ns: int | None = None, window: int = 20) -> None:
        """`drift`: how fast the clocks may part at least, s/s. `fixed_ns`: a known offset; answers are then ignored."""
        self._drift, self._fixed = drift, fixed_ns is not None
        self._samples: deque[tuple[int, int, int]] = deque(maxlen=window)
        self.offset_ns: int | None = fixed_ns
        self.round_trip_ns = 0
        self.rejected = 0

    def add(self, sent_ns: int, px4_ns: int, now_ns: int) -> None:
        """A TIMESYNC answer: we asked at `sent_ns`, PX4 stamped `px4_ns`, the answer is here at `now_ns`.

        Answers to nothing we can have asked (negative or over-long round trips) are rejected and counted.
        """
        round_trip = now_ns - sent_ns
        if not 0 <= round_trip < _LONGEST_TRIP_NS:
            self.rejected += 1
            return
        self.round_trip_ns = round_trip
        if self._fixed:
            return
        offset = px4_ns - (sent_ns + now_ns) // 2
        drift = max((self._proven(now_ns, round_trip, offset, old) for old in self._samples), default=0.0)
        drift = max(drift, self._drift)
        self._samples.append((now_ns, round_trip, offset))

        def bound(sample: tuple[int, int, int]) -> float:
            then, trip, _ = sample
            return 0.5 * trip + drift * (now_ns - then)

        self.offset_ns = min(reversed(self._samples), key=bound)[2]

    @staticmethod
    def _proven(now_ns: int, round_trip: int, offset: int, old: tuple[int, int, int]) -> float:
        """How fast the clocks must have parted for both answers to be true, s/s; at most 0 if they agree."""
        then, trip, old_offset = old
        return (abs(offset - old_offset) - 0.5 * (trip + round_trip)) / max(1, now_ns - then)

    def ours(self, px4_ns: int) -> int | None:
        """A PX4 time on our clock, None before the first answer."""
        return None if self.offset_ns is None else px4_ns - self.offset_ns

    def forget(self) -> None:
        """PX4 has rebooted: nothing heard before counts."""
        self._samples.clear()
        if not self._fixed:
            self.offset_ns = None


class LinkTime:
    """Time in which the driver waits: PX4's while its stamps come, ours while they do not.

    A simulated PX4 runs slower than wall time on a busy machine; a timeout in wall time would give up on it.
    """

    def __init__(self) -> None:
        self.ns = 0
        self._our_ns: int | None = None
        self._heard_ns = 0
        self._px4_ns: int | None = None
        self._gained_ns = 0
        self.reboots = 0

    def heard(self, px4_ns: int) -> bool:
        """A stamp from PX4 (ns since its boot); True if PX4 has rebooted since the last one."""
        if self._px4_ns is None or px4_ns < self._px4_ns - 1_000_000_000:
            rebooted = self._px4_ns is not None
            self.reboots += rebooted
            self._px4_ns = px4_ns
            return rebooted
        if px4_ns > self._px4_ns:
            self._gained_ns += min(px4_ns - self._px4_ns, 1_000_000_000)
            self._px4_ns = px4_ns
        return False

    def advance(self, now_ns: int) -> None:
        """One step of the driver, after it has heard what there was."""
        passed = 0 if self._our_ns is None else max(0, now_ns - self._our_ns)
        self._our_ns = now_ns
        if self._gained_ns:
            self._heard_ns = now_ns
            self.ns += self._gained_ns
            self._gained_ns = 0
        elif self._px4_ns is None or now_ns - self._heard_ns > 1_000_000_000:
            self.ns += passed
