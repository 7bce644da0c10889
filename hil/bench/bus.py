"""Test of the live bus on this computer: a hub and two leaves on a separate port, for half a second."""

from __future__ import annotations

import socket
import time
from dataclasses import dataclass
from pathlib import Path

from hil.bench.reading import Unavailable
from hil.bus.clock import Clock
from hil.bus.leaf import Bus, BusError, Mailbox, credentials_in, open_hub
from hil.bus.mailbox import PICTURES
from hil.bus.session import no_shared_memory
from hil.contract.messages import Image, VehicleState

_TOPIC = "mocap/vehicle"
_MESSAGES = 100
_PERIOD_S = 0.005
_PICTURES, _WIDTH, _HEIGHT = 20, 1280, 720
_FIRST_PICTURES = 30
_PICTURE_S = 0.1  # six times the period of 60 Hz
_LEVEL = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class BusReport:
    """Publication to arrival at another leaf, ms, over the messages that arrived, of those sent; and pictures, which
    take another way: `remark` states why, if it is not the usual one."""

    median_ms: float
    worst_ms: float
    arrived: int
    sent: int
    pictures: int
    pictures_sent: int
    remark: str


def measure_bus() -> BusReport:
    """Send a hundred poses at 200 Hz, then twenty pictures once a first one arrives. Raises Unavailable if the bus
    does not start or no pose arrives."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    mailbox = Mailbox()
    try:
        with open_hub(endpoint), Bus(endpoint) as sender, Bus(endpoint) as receiver:
            receiver.subscribe("recorder", [_TOPIC, PICTURES], mailbox)
            sender.announce([_TOPIC, PICTURES])
            _first(sender, mailbox)
            delays: list[int] = []
            for _ in range(_MESSAGES):
                _send(sender)
                mailbox.wait(round(_PERIOD_S * 1e9))
                _collect(mailbox, delays)
                time.sleep(_PERIOD_S)
            mailbox.wait(100_000_000)
            _collect(mailbox, delays)
            # the pool of shared memory is made with the first picture, and pictures are lost meanwhile
            any(_picture_arrives(sender, mailbox, number) for number in range(_FIRST_PICTURES))
            pictures = sum(_picture_arrives(sender, mailbox, number) for number in range(_PICTURES))
    except BusError as error:
        raise Unavailable(str(error)) from None
    finally:
        mailbox.close()
    if not delays:
        raise Unavailable("nothing that was sent over the bus arrived")
    delays.sort()
    return BusReport(
        delays[len(delays) // 2] * 1e-6, delays[-1] * 1e-6, len(delays), _MESSAGES, pictures, _PICTURES,
        no_shared_memory(),
    )  # fmt: skip


def compare_clocks(endpoint: str, keys: Path | None) -> Clock:
    """This host's clocks against those of the hub at `endpoint`. Raises Unavailable if no hub answers there."""
    try:
        with Bus(endpoint, credentials_in(keys, "status") if keys is not None else None) as bus:
            return bus.clock().measure()
    except (BusError, TimeoutError, OSError, ValueError) as error:
        raise Unavailable(str(error)) from None


def _first(sender: Bus, mailbox: Mailbox) -> None:
    """Wait until the subscription has reached the sender."""
    end = time.monotonic() + 3.0
    while time.monotonic() < end:
        _send(sender)
        mailbox.wait(50_000_000)
        if mailbox.drain():
            time.sleep(0.05)
            mailbox.drain()
            return
    raise Unavailable("nothing that was sent over the bus arrived")


def _send(sender: Bus) -> None:
    still = (0.0, 0.0, 0.0)
    now = time.monotonic_ns()
    sender.publish(now, _TOPIC, VehicleState(now, still, still, _LEVEL, still))


def _picture_arrives(sender: Bus, mailbox: Mailbox, number: int) -> bool:
    """Whether one full-size picture arrives whole."""
    data = bytes([number]) * (_WIDTH * _HEIGHT)
    now = time.monotonic_ns()
    sender.publish(now, PICTURES, Image(now, _WIDTH, _HEIGHT, 1, data, number))
    end = now + round(_PICTURE_S * 1e9)
    found = False
    while not found and time.monotonic_ns() < end:
        mailbox.wait(end - time.monotonic_ns())
        found = any(one.topic == PICTURES and one.message.data == data for one in mailbox.drain())
    return found


def _collect(mailbox: Mailbox, delays: list[int]) -> None:
    arrived = time.monotonic_ns()
    delays += [arrived - delivery.published_ns for delivery in mailbox.drain()]
