"""Measures over the bus how far this host's clocks are from the hub's; the answer with the shortest round trip counts.

The run uses the monotonic clock, which is never set; the date (Unix time) is only for files and signatures.
"""

from __future__ import annotations

import os
import struct
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import zenoh

CLOCK = "perch/clock"
STEP_NS = 50_000_000  # of the date: slewing is slower than this between two readings
_AGAIN_S = 0.05
_WINDOW = 20  # readings of which the best counts; the older ones have drifted away
_ANSWER = struct.Struct("<qq")


class Clock(NamedTuple):
    """The hub's clocks less ours, ns. `error_ns`: half the round trip, which bounds the error of both.

    `shared`: hub and this process read one monotonic clock, so that the offset is 0 whatever was measured.
    """

    offset_ns: int
    error_ns: int
    date_ns: int
    shared: bool


def clock_id() -> bytes:
    """Names the monotonic clock of this process: this boot of this machine, and the time namespace."""
    name = b""
    for read in (_boot, _namespace):
        with suppress(OSError):
            name += read()
    return name or os.uname().nodename.encode()


def _boot() -> bytes:
    return Path("/proc/sys/kernel/random/boot_id").read_bytes().strip()


def _namespace() -> bytes:
    return str(Path("/proc/self/ns/time").readlink()).encode()


def answer_clock(session: zenoh.Session) -> None:
    """Answer clock requests with the hub's clocks."""
    own = clock_id()

    def answer(query: zenoh.Query) -> None:
        query.reply(CLOCK, _ANSWER.pack(time.monotonic_ns(), time.time_ns()), attachment=own)

    session.declare_queryable(CLOCK, zenoh.handlers.Callback(answer, indirect=False))


def compare(began_ns: int, ended_ns: int, theirs_ns: int, theirs_date_ns: int, date_ns: int, shared: bool) -> Clock:
    """One request and answer, as in NTP: the answer is dated half-way between sending the request and receiving it.

    `date_ns`: our date less our monotonic clock.
    """
    middle = (began_ns + ended_ns) // 2
    half = (ended_ns - began_ns + 1) // 2
    return Clock(0 if shared else theirs_ns - middle, half, theirs_date_ns - middle - date_ns, shared)


class ClockWatch:
    """Readings of the hub's clocks. `measure` waits for them; `ask` does not: its answer counts on arrival."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session, self._own = session, clock_id()
        self._readings: deque[Clock] = deque(maxlen=_WINDOW)
        self._first: Clock | None = None

    def measure(self, tries: int = 15, limit_s: float = 5.0) -> Clock:
        """Request `tries` answers, one after the other. Raises TimeoutError if none comes within `limit_s`.

        A hub accepts leaves shortly before it answers, and a request without a receiver returns at once.
        """
        until = time.monotonic() + limit_s
        while tries and time.monotonic() < until:
            began = time.monotonic_ns()
            for reply in self._session.get(CLOCK, timeout=1.0):
                self._take(began, reply)
            if self.best is None:
                time.sleep(_AGAIN_S)
            else:
                tries -= 1
        best = self.best
        if best is None:
            raise TimeoutError("the hub does not answer for its clock: is it a hub of perch-hil?")
        self._first = best
        return best

    def ask(self) -> None:
        """Send one more request."""
        began = time.monotonic_ns()

        def take(reply: zenoh.Reply) -> None:
            self._take(began, reply)

        self._session.get(CLOCK, zenoh.handlers.Callback(take, indirect=False), timeout=1.0)

    def _take(self, began_ns: int, reply: zenoh.Reply) -> None:
        ended = time.monotonic_ns()
        if reply.ok is None or reply.ok.attachment is None:
            return
        with suppress(struct.error):
            theirs, date = _ANSWER.unpack(reply.ok.payload.to_bytes())
            ours = time.time_ns() - time.monotonic_ns()
            shared = reply.ok.attachment.to_bytes() == self._own
            self._readings.append(compare(began_ns, ended, theirs, date, ours, shared))

    @property
    def best(self) -> Clock | None:
        """The reading of the least round trip among the newest; None before the first."""
        return min(list(self._readings), key=lambda reading: reading.error_ns, default=None)

    @property
    def moved_ns(self) -> int:
        """How far the clocks have drifted apart since `measure`."""
        best = self.best
        return 0 if best is None or self._first is None else best.offset_ns - self._first.offset_ns


class DateWatch:
    """Detects that this host's date was set."""

    def __init__(
        self, unix: Callable[[], int] = time.time_ns, monotonic: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._unix, self._monotonic = unix, monotonic
        self._between_ns = unix() - monotonic()
        self.steps = 0

    def text(self) -> str:
        """What happened to the date since the last call; empty while nothing did."""
        between = self._unix() - self._monotonic()
        by, self._between_ns = between - self._between_ns, between
        if abs(by) < STEP_NS:
            return ""
        self.steps += 1
        way = "forward" if by > 0 else "back"
        return (
            f"the date was set {way} by {abs(by) / 1e9:.3f} s: the run goes by the monotonic clock and is not "
            "affected, times of day in its files are"
        )
