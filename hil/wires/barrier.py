"""A MAVLink wire for hosts without real time, to a firmware whose clock the host drives.

The other end is a process with threads of its own, which the host's clock must not leave behind. What is sent has been
processed before `send` returns: a PING follows it, which the firmware answers where it receives, after all before it.
And `receive` waits for odometry that is due, once it comes as often as it was asked for.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from vehicle.px4.codec import MESSAGES, Packer, Parser

_PATIENCE_S = 0.2
_IDS = (245, 51)
_FAST_US, _LATE_US, _STOPPED_US = 14_000, 16_000, 500_000  # between two odometries; age of the last, of a lost stream


class BarrierWire:
    """A byte wire around another one. `missed` counts PINGs and odometries that did not come in time."""

    def __init__(self, wire: Any, clock_us: Callable[[], int]) -> None:
        """`clock_us`: the firmware's time."""
        self._wire, self._clock_us = wire, clock_us
        self._packer, self._parser = Packer(*_IDS), Parser()
        self._waiting: list[bytes] = []
        self._ping, self._odometry = MESSAGES["PING"], MESSAGES["ODOMETRY"].id
        self._sequence = self._answered = self.missed = 0
        self._stamp_us = self._gap_us = -1
        self._heard = False

    def send(self, data: bytes) -> None:
        """Send, and wait until it has been processed; not before the firmware has been heard."""
        self._wire.send(data)
        self._exchange()

    def receive(self) -> list[bytes]:
        """What has come, oldest first, and the odometry that is due."""
        self._poll()
        self._wait(self._due)
        pieces, self._waiting = self._waiting, []
        return pieces

    def close(self) -> None:
        self._wire.close()

    def _exchange(self) -> None:
        """A PING and its answer. A firmware that does not answer is asked again once it has been heard again."""
        if self._heard:
            self._sequence += 1
            self._wire.send(self._packer.pack(self._ping, 0, self._sequence, 0, 0))
            self._heard = self._wait(lambda: self._answered != self._sequence)

    def _due(self) -> bool:
        age_us = self._clock_us() - self._stamp_us
        return 0 < self._gap_us <= _FAST_US and _LATE_US < age_us < _STOPPED_US

    def _wait(self, while_: Callable[[], bool]) -> bool:
        """Whether it ended in time."""
        until = time.monotonic() + _PATIENCE_S
        while while_():
            late = time.monotonic() > until  # before the look, as this process may have slept
            self._poll()
            if late and while_():
                self.missed += 1
                self._gap_us = -1  # a stream that has stopped is not waited for at every step
                return False
        return True

    def _poll(self) -> None:
        pieces = self._wire.receive()
        self._heard = self._heard or bool(pieces)
        self._waiting += pieces
        for piece in pieces:
            for frame in self._parser.feed(piece):
                if frame.id == self._odometry:
                    stamp_us = frame.fields.time_usec
                    self._gap_us, self._stamp_us = stamp_us - self._stamp_us, stamp_us
                elif frame.id == self._ping.id and frame.fields.target_system == _IDS[0]:
                    self._answered = frame.fields.seq
