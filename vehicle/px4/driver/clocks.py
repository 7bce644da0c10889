"""The driver's two times: the offset between our clock and PX4's (TIMESYNC), and the time of its timeouts."""

from __future__ import annotations

from collections import deque

_LONGEST_TRIP_NS = 500_000_000
# Two answers that contradict each other by more than that, and that share of the time between them, are no drift: one
# of them is broken. A simulated PX4 may stand still and catch up.
_CONTRADICTION_NS, _FASTEST = 100_000_000, 20.0
_AGREED = 3  # answers in a row that contradict the ones before it: then those are given up


class ClockOffset:
    """Keeps `offset_ns` = PX4 time - our time, from the TIMESYNC answer that bounds it best.

    The error of an answer is at most half its round trip when it comes, and grows with the drift of the clocks. The
    drift is at least the one that follows from two answers with contradicting bounds: a simulated PX4 may lag.
    """

    def __init__(self, drift: float = 1e-4, fixed_ns: int | None = None, window: int = 20) -> None:
        """`drift`: lower bound of the clocks' relative drift, s/s. `fixed_ns`: a known offset, answers are ignored."""
        self._drift, self._fixed = drift, fixed_ns is not None
        self._samples: deque[tuple[int, int, int]] = deque(maxlen=window)
        self.offset_ns: int | None = fixed_ns
        self.round_trip_ns = 0
        self.rejected = 0
        self._contradictions = 0

    def add(self, sent_ns: int, px4_ns: int, now_ns: int) -> None:
        """A TIMESYNC answer: requested at `sent_ns`, stamped `px4_ns` by PX4, received at `now_ns`.

        Answers with a negative or an over-long round trip are rejected and counted; so is one that contradicts the
        last one beyond any drift: it would put the stamps of all data hours off.
        """
        round_trip = now_ns - sent_ns
        if not 0 <= round_trip < _LONGEST_TRIP_NS:
            self.rejected += 1
            return
        self.round_trip_ns = round_trip
        if self._fixed:
            return
        offset = px4_ns - (sent_ns + now_ns) // 2
        if self._contradicts(now_ns, round_trip, offset):
            self._contradictions += 1
            if self._contradictions < _AGREED:
                self.rejected += 1
                return
            self._samples.clear()
        self._contradictions = 0
        drift = max((self._proven(now_ns, round_trip, offset, old) for old in self._samples), default=0.0)
        drift = max(drift, self._drift)
        self._samples.append((now_ns, round_trip, offset))

        def bound(sample: tuple[int, int, int]) -> float:
            then, trip, _ = sample
            return 0.5 * trip + drift * (now_ns - then)

        self.offset_ns = min(reversed(self._samples), key=bound)[2]

    def _contradicts(self, now_ns: int, round_trip: int, offset: int) -> bool:
        if not self._samples:
            return False
        then, trip, old_offset = self._samples[-1]
        beyond = abs(offset - old_offset) - 0.5 * (trip + round_trip)
        return beyond > _CONTRADICTION_NS + _FASTEST * (now_ns - then)

    @staticmethod
    def _proven(now_ns: int, round_trip: int, offset: int, old: tuple[int, int, int]) -> float:
        """The least drift with which both answers are consistent, s/s; at most 0 if they agree."""
        then, trip, old_offset = old
        return (abs(offset - old_offset) - 0.5 * (trip + round_trip)) / max(1, now_ns - then)

    def ours(self, px4_ns: int) -> int | None:
        """A PX4 time on our clock, None before the first answer."""
        return None if self.offset_ns is None else px4_ns - self.offset_ns

    def forget(self) -> None:
        """PX4 has rebooted: earlier answers are not valid."""
        self._samples.clear()
        if not self._fixed:
            self.offset_ns = None


class LinkTime:
    """Time of the driver's timeouts: PX4's while its stamps come, ours while they do not.

    A simulated PX4 runs slower than wall time on a busy machine; a timeout in wall time would expire too early.
    """

    def __init__(self) -> None:
        self.ns = 0
        self._our_ns: int | None = None
        self._received_ns = 0
        self._px4_ns: int | None = None
        self._gained_ns = 0
        self.reboots = 0

    def receive(self, px4_ns: int) -> bool:
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
        """One step of the driver, after it has processed the received frames."""
        passed = 0 if self._our_ns is None else max(0, now_ns - self._our_ns)
        self._our_ns = now_ns
        if self._gained_ns:
            self._received_ns = now_ns
            self.ns += self._gained_ns
            self._gained_ns = 0
        elif self._px4_ns is None or now_ns - self._received_ns > 1_000_000_000:
            self.ns += passed
