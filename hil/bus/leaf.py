"""A leaf of the bus between processes: publishes and receives the contract's messages as protobuf bytes.

Publication time and running number are sent beside each message. Every subscription is checked against
`hil/contract/topics.py`, and enforced by the hub's access list over TLS.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import zenoh

from hil.bus.clock import ClockWatch
from hil.bus.mailbox import PICTURES, STAMP, Delivery, Mailbox
from hil.bus.session import BusError, Credentials, credentials_in, open_hub, open_leaf
from hil.contract.codec import codec
from hil.contract.topics import TOPICS, Knows, may_read, readers_of

TOPIC, CONTROL, HEALTH = "perch/topic/", "perch/control", "perch/health/"
EVENT = TOPIC + "event/"  # every identity has a key of its own below it: events have many publishers
OBSERVERS = ("recorder", "supervisor", "status", "viewer")  # of the harness, never of a slot: they read every topic


class Publisher:
    """One topic's publisher; numbers what it sends from 0."""

    def __init__(self, session: zenoh.Session, topic: str, identity: str, number: int) -> None:
        """`identity` and `number` of the session that publishes."""
        self._codec, self._sequence, self._number = codec(TOPICS[topic].message), 0, number
        picture = topic == PICTURES
        # not express: while a link is busy messages share a batch, so that its queue holds thousands instead of 16
        # DROP: a reader that has stopped loses messages; it must not block the hub and with it all services
        self._publisher = session.declare_publisher(
            EVENT + identity if topic == "event" else TOPIC + topic,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA if picture else zenoh.Priority.REAL_TIME,
        )

    def put(self, now_ns: int, message: Any) -> int:
        """Publish; returns the message's number. Raises CodecError for a value the message cannot hold.

        What the session cannot send is a lost message, as one on a busy link: no service ends because of it.
        """
        sequence, self._sequence = self._sequence, self._sequence + 1
        payload = self._codec.encode(message)
        with suppress(zenoh.ZError):
            self._publisher.put(payload, attachment=STAMP.pack(now_ns, sequence, self._number))
        return sequence


class Bus:
    """A leaf. Use as a context manager: a session left open can hang the process at exit."""

    def __init__(
        self,
        endpoint: str,
        credentials: Credentials | None = None,
        timeout_s: float = 5.0,
        *,
        identity: str = "unnamed",
        knows: Knows = "camera",
    ) -> None:
        """Connect to the hub at `endpoint`. Raises BusError if none answers within `timeout_s`.

        `identity`: the service or observer that this process is; a closed bus holds it against its certificate.
        `knows`: by what the run's policy may know of the board.
        """
        self._knows: Knows = knows
        self._session = open_leaf(endpoint, credentials, timeout_s)
        self._identity, self._number = identity, int.from_bytes(os.urandom(8), "little")
        self._publishers: dict[str, Publisher] = {}
        self._delivered: set[tuple[int, str]] = set()  # mailbox, topic

    def publish(self, now_ns: int, topic: str, message: Any) -> int:
        """Publish on `topic` at the run's time `now_ns`; returns the message's number."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            publisher = self._publishers[topic] = self._publisher(topic)
        return publisher.put(now_ns, message)

    def _publisher(self, topic: str) -> Publisher:
        return Publisher(self._session, topic, self._identity, self._number)

    @property
    def session(self) -> str:
        """Tells this process from another one of the same identity."""
        return f"{self._number:016x}"

    def announce(self, topics: Iterable[str]) -> None:
        """Declare publishers beforehand, so that the first message costs no more than the next."""
        for topic in topics:
            self._publishers.setdefault(topic, self._publisher(topic))

    def subscribe(self, reader: str, topics: Iterable[str], mailbox: Mailbox) -> None:
        """Put deliveries of `topics` into `mailbox`, each once, however many readers share it.

        Raises BusError if the contract does not let `reader` read one.
        """
        for topic in topics:
            if topic not in TOPICS:
                raise BusError(f"{reader} asks for topic {topic!r}, which hil/contract/topics.py does not list")
            if reader not in OBSERVERS and not may_read(reader, topic, self._knows):
                readers = ", ".join(readers_of(topic, self._knows)) or "no node"
                raise BusError(f"{reader} may not read {topic!r}: the contract allows {readers}")
            if (id(mailbox), topic) in self._delivered:
                continue
            self._delivered.add((id(mailbox), topic))

            def take(sample: zenoh.Sample, topic: str = topic) -> None:
                stamp = sample.attachment.to_bytes() if sample.attachment is not None else b""
                if mailbox.wanted(topic, stamp):
                    author = str(sample.key_expr).removeprefix(EVENT) if topic == "event" else ""
                    mailbox.put(topic, sample.payload.to_bytes(), stamp, author)

            self._listen(received_on(topic), take)

    def ages(self, topics: Iterable[str], counts: dict[str, int] | None = None) -> dict[str, int]:
        """A live table: topic -> monotonic ns of its last arrival; arrivals are counted in `counts`. Payloads are not
        looked at."""
        received: dict[str, int] = {}
        for topic in topics:

            def note(_: zenoh.Sample, topic: str = topic) -> None:
                received[topic] = time.monotonic_ns()
                if counts is not None:
                    counts[topic] = counts.get(topic, 0) + 1

            self._listen(received_on(topic), note)
        return received

    def census(self) -> dict[str, int]:
        """A live table: key -> messages from now on, of every key of the bus."""
        counts: dict[str, int] = {}

        def note(sample: zenoh.Sample) -> None:
            key = str(sample.key_expr)
            counts[key] = counts.get(key, 0) + 1

        for key in (*map(received_on, TOPICS), HEALTH + "*", CONTROL):
            self._listen(key, note)
        return counts

    def send_table(self, key: str, table: dict[str, Any]) -> None:
        """Send a table of the harness's own (CONTROL, HEALTH + service): not part of the contract, not recorded.

        Never waits, as `publish` never does: a hub that waits for a stopped reader blocks all services, and a driver
        that waits for the hub delays its vehicle. What has to arrive is sent again.
        """
        text = json.dumps(table)
        with suppress(zenoh.ZError):
            self._session.put(
                key, text, priority=zenoh.Priority.REAL_TIME,
                congestion_control=zenoh.CongestionControl.DROP, express=True,
            )  # fmt: skip

    def on_table(self, key: str, take: Callable[[dict[str, Any]], None]) -> None:
        """Call `take` (which must only store) with every table sent on `key`; what is no table is ignored.

        The "service" of a health is the one of its key, which a closed bus checks, not the one in the table.
        """

        def parse(sample: zenoh.Sample) -> None:
            with suppress(ValueError, RecursionError):
                table = json.loads(sample.payload.to_bytes())
                if isinstance(table, dict):
                    came_on = str(sample.key_expr)
                    if came_on.startswith(HEALTH):
                        table["service"] = came_on.removeprefix(HEALTH)
                    take(table)

        self._listen(key, parse)

    def clock(self) -> ClockWatch:
        """Compares this host's clocks with the hub's."""
        return ClockWatch(self._session)

    def _listen(self, key: str, take: Callable[[zenoh.Sample], None]) -> None:
        self._session.declare_subscriber(key, zenoh.handlers.Callback(take, indirect=False))

    def close(self) -> None:
        """Leave the bus; may be called twice."""
        with suppress(zenoh.ZError):
            self._session.close()

    def __enter__(self) -> Bus:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def received_on(topic: str) -> str:
    """The key expression on which `topic` is received."""
    return EVENT + "*" if topic == "event" else TOPIC + topic


__all__ = [
    "CONTROL", "EVENT", "HEALTH", "OBSERVERS", "TOPIC", "Bus", "BusError", "Credentials", "Delivery", "Mailbox",
    "credentials_in", "open_hub",
]  # fmt: skip
