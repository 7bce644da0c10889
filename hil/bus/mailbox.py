"""Deliveries for one service: the bus's threads store them here until the service takes them."""

from __future__ import annotations

import os
import select
import struct
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from typing import Any, NamedTuple

from hil.contract.codec import CodecError, codec
from hil.contract.topics import TOPICS

PICTURES = "camera/image"
# beside every payload: time of publication by the run's clock (ns), running number, the publisher's session
STAMP = struct.Struct("<qQQ")
_NUMBER_LIMIT = 1 << 32  # a message numbered higher is garbage: 500 Hz reach it after 99 days
_GAP_LIMIT = 1 << 16  # more numbers missing at once than any topic has in the time after which a run is aborted
_DEPTH = 256  # messages kept of a topic while its reader is busy; pictures: the newest only


class Delivery(NamedTuple):
    """A message received from the bus, with its topic and number. `published_ns`: the run's time by the publisher's
    clock. `author`: of an event, the identity on whose key it came; of other topics empty."""

    topic: str
    published_ns: int
    sequence: int
    message: Any
    author: str = ""


class Mailbox:
    """Deliveries for one service. Callbacks only append, of pictures only the newest; `wait` sleeps until one comes."""

    def __init__(
        self,
        depth: int = _DEPTH,
        pictures: int = 1,
        urgent: Iterable[str] | None = None,
        picture_period_ns: int = 0,
    ) -> None:
        """`depth` of a topic and `pictures` are how many wait at most; the oldest make room and are counted. Pictures
        published sooner than `picture_period_ns` after the last one taken are not wanted: passed over, not counted.

        `urgent`: topics that end a `wait`; the others wait for the next `drain`. None: all do.
        """
        self._depth, self._pictures = depth, pictures
        self._picture_period_ns, self._picture_ns = picture_period_ns, -picture_period_ns
        self._urgent = None if urgent is None else frozenset(urgent)
        self._queues: dict[str, deque[tuple[int, bytes, bytes, str]]] = {}
        self._arrivals = 0
        self._fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self.dropped: dict[str, int] = {}
        self.lost: dict[str, int] = {}  # numbers missing in what arrived
        self.garbage = 0
        self.strangers: dict[str, int] = {}  # messages of a second publisher of a topic: not delivered
        self._expected: dict[str, int] = {}
        self._publishers: dict[str, int] = {}  # topic -> session of its publisher, the first that was heard

    def forget(self) -> None:
        """Whatever has arrived so far, and from which publishers, does not count: the run starts."""
        self.drain()
        for table in (self.lost, self.strangers, self._expected, self._publishers):
            table.clear()

    def put(self, topic: str, payload: bytes, stamp: bytes, author: str = "") -> None:
        """Called by the bus's threads with what is `wanted`."""
        queue = self._queues.get(topic)
        if queue is None:
            queue = self._queues.setdefault(topic, deque(maxlen=self._pictures if topic == PICTURES else self._depth))
        if len(queue) == queue.maxlen:
            self.dropped[topic] = self.dropped.get(topic, 0) + 1
        self._arrivals += 1
        queue.append((self._arrivals, payload, stamp, author))
        if self._urgent is None or topic in self._urgent:
            self.wake()

    def wanted(self, topic: str, stamp: bytes) -> bool:
        """Whether to `put` it, asked before a picture is copied. Called by the bus's threads."""
        if not self._picture_period_ns or topic != PICTURES or len(stamp) != STAMP.size:
            return True  # garbage is counted where it is opened
        published_ns, _, session = STAMP.unpack(stamp)
        if self._publishers.get(topic, session) != session:
            return True  # counted where it is opened
        if 0 <= published_ns - self._picture_ns < self._picture_period_ns:
            return False
        self._picture_ns = published_ns
        return True

    def wake(self) -> None:
        """End a `wait` now."""
        with suppress(BlockingIOError, OSError):
            os.eventfd_write(self._fd, 1)

    def wait(self, timeout_ns: int, also: Iterable[int] = ()) -> list[int]:
        """Sleep until a delivery comes or there is something to read from a descriptor of `also`, at most `timeout_ns`.

        Returns which of them.
        """
        ready, _, _ = select.select([self._fd, *also], [], [], max(0, timeout_ns) * 1e-9)
        with suppress(BlockingIOError):
            os.eventfd_read(self._fd)
        return [fd for fd in ready if fd != self._fd]

    def drain(self) -> list[Delivery]:
        """Deliveries in the order of arrival. Anything that is not a message of its topic is counted in `garbage`."""
        found: list[tuple[int, str, bytes, bytes, str]] = []
        for topic, queue in list(self._queues.items()):
            for _ in range(len(queue)):  # a flood may not keep the reader here
                arrival, payload, stamp, author = queue.popleft()
                found.append((arrival, topic, payload, stamp, author))
        return [delivery for item in sorted(found) if (delivery := self._open(*item)) is not None]

    def _open(self, _: int, topic: str, payload: bytes, stamp: bytes, author: str) -> Delivery | None:
        try:
            published_ns, sequence, session = STAMP.unpack(stamp)
            if topic != "event" and self._publishers.setdefault(topic, session) != session:
                self.strangers[topic] = self.strangers.get(topic, 0) + 1
                return None
            message = codec(TOPICS[topic].message).decode(payload)
        except (struct.error, CodecError, KeyError):
            self.garbage += 1
            return None
        gap = sequence - self._expected.get(topic, sequence)
        if sequence >= _NUMBER_LIMIT or gap > _GAP_LIMIT:
            self.garbage += 1
            return None
        thinned = topic == PICTURES and self._picture_period_ns > 0
        if gap > 0 and topic != "event" and not thinned:  # events have several publishers
            self.lost[topic] = self.lost.get(topic, 0) + gap
        self._expected[topic] = sequence + 1
        return Delivery(topic, published_ns, sequence, message, author)

    def close(self) -> None:
        """Free the descriptor."""
        with suppress(OSError):
            os.close(self._fd)
