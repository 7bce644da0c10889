"""A MAVLink wire for hosts without real time, to a firmware whose clock the host drives.

The other end is a process with threads of its own, which the host's clock must not leave behind. A set-point has been
processed before `send` returns: a PING follows it, which the firmware answers where it receives, after all before it.
And `receive` waits for odometry that is due, once it comes as often as it was asked for.

Waits end, as some answers need the clock to go on: PX4 receives nothing until the stream that a command asks for begins
(so that a command has its acknowledgement and no PING), and leaves out an odometry where its thread was late.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from vehicle.px4.codec import MESSAGES, Packer, Parser, message_id

_PING_S, _ODOMETRY_S = 0.2, 0.02  # waited at most; a quiet machine answers in 0.1 ms
_IDS = (245, 51)
_FLOWN = {MESSAGES[name].id for name in ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED", "ODOMETRY")}
_FAST_US, _LATE_US, _STOPPED_US = 14_000, 16_000, 500_000  # between two odometries; age of the last, of a lost stream


class BarrierWire:
    """A byte wire around another one. `missed` counts PINGs and odometries that did not come in time."""

    def __init__(self, wire: Any, clock_us: Callable[[], int]) -> None:
        """`clock_us`: the firmware's time."""
        self._wire, self._clock_us = wire, clock_us
        self._packer, self._parser = Packer(*_IDS), Parser()
        self._waiting: list[bytes] = []
        self._ping, self._odometry = MESSAGES["PING"], MESSAGES["ODOMETRY"].id
        self._sequence = self.missed = 0
        self._answered = self._stamp_us = self._gap_us = -1

    def send(self, data: bytes) -> None:
        """Send; set-points and poses are waited for, until they have been processed."""
        self._wire.send(data)
        if message_id(data) in _FLOWN:
            self._exchange()

    def receive(self) -> list[bytes]:
        """What has come, oldest first, and the odometry that is due."""
        self._poll()
        self._wait(self._due, _ODOMETRY_S)
        pieces, self._waiting = self._waiting, []
        return pieces

    def close(self) -> None:
        self._wire.close()

    def _exchange(self) -> None:
        """A PING and, of a firmware that has answered the last one, its answer."""
        answers = self._answered == self._sequence
        self._sequence += 1
        self._wire.send(self._packer.pack(self._ping, 0, self._sequence, 0, 0))
        if answers:
            self._wait(lambda: self._answered != self._sequence, _PING_S)

    def _due(self) -> bool:
        age_us = self._clock_us() - self._stamp_us
        return 0 < self._gap_us <= _FAST_US and _LATE_US < age_us < _STOPPED_US

    def _wait(self, while_: Callable[[], bool], limit_s: float) -> None:
        """Until `while_` is false, or counted in vain."""
        until = time.monotonic() + limit_s
        while while_():
            late = time.monotonic() > until  # before the look, as this process may have slept
            self._poll()
            if late and while_():
                self.missed += 1
                self._gap_us = -1  # a stream that has stopped is not waited for at every step
                return

    def _poll(self) -> None:
        pieces = self._wire.receive()
        self._waiting += pieces
        for piece in pieces:
            for frame in self._parser.feed(piece):
                if frame.id == self._odometry:
                    stamp_us = frame.fields.time_usec
                    self._gap_us, self._stamp_us = stamp_us - self._stamp_us, stamp_us
                elif frame.id == self._ping.id and frame.fields.target_system == _IDS[0]:
                    self._answered = frame.fields.seq
