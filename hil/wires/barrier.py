"""A MAVLink wire for hosts without real time: the firmware has processed what was sent before `send` returns.

The other end is a process with threads of its own. A PING follows what is sent, and its answer is waited for: the
firmware answers it where it receives, after all that came before it. Without this a set-point would reach the firmware
at some later time of its clock, which the host drives.
"""

from __future__ import annotations

import time
from typing import Any

from vehicle.px4.codec import MESSAGES, Packer, Parser

_PATIENCE_S = 0.2
_IDS = (245, 51)


class BarrierWire:
    """A byte wire around another one. `missed` counts PINGs that were not answered in time."""

    def __init__(self, wire: Any) -> None:
        self._wire = wire
        self._packer, self._parser = Packer(*_IDS), Parser()
        self._waiting: list[bytes] = []
        self._ping = MESSAGES["PING"]
        self._sequence = self.missed = 0
        self._heard = False

    def send(self, data: bytes) -> None:
        """Send, and wait until it has been processed; not before the firmware has been heard."""
        self._wire.send(data)
        if not self._heard:
            return
        self._sequence += 1
        self._wire.send(self._packer.pack(self._ping, 0, self._sequence, 0, 0))
        until = time.monotonic() + _PATIENCE_S
        while time.monotonic() < until:
            pieces = self._wire.receive()
            self._waiting += pieces
            if any(self._answers(piece) for piece in pieces):
                return
        self.missed += 1

    def receive(self) -> list[bytes]:
        """What has come, oldest first; never waits."""
        pieces, self._waiting = [*self._waiting, *self._wire.receive()], []
        self._heard = self._heard or bool(pieces)
        return pieces

    def close(self) -> None:
        self._wire.close()

    def _answers(self, piece: bytes) -> bool:
        frames = self._parser.feed(piece)
        return any(
            f.name == "PING" and f.fields.seq == self._sequence and f.fields.target_system == _IDS[0] for f in frames
        )
