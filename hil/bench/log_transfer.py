"""An autopilot's log by MAVLink's log protocol, from where an earlier transfer of it stopped.

MAVSDK's own download always begins anew, and over a telemetry radio of 5 kB/s a log of 20 MB takes an hour. Here MAVSDK
carries only the messages.
"""

from __future__ import annotations

import json
import queue
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import mavsdk
from mavsdk.plugins.mavlink_direct import MavlinkDirect, MavlinkMessage

from hil.bench.reading import Unavailable

_BLOCK = 90  # bytes of a LOG_DATA
# Asked for at once, and written when it is whole. By UDP PX4 sends all of it in one burst, and the kernel's default
# buffer of a socket holds 107 such datagrams.
_CHUNK = 96 * _BLOCK
_BRIDGE = 10 * _BLOCK  # sending this much twice takes no longer than asking once more
_QUIET_S = 0.5  # without a block, after which the missing ones are asked for again
_AUTOPILOT = 1  # its component id


class LogTransfer:
    """Reads logs on one connection. Use it as a context: it ends the autopilot's sending."""

    def __init__(self, system: mavsdk.System) -> None:
        self._direct, self._system = MavlinkDirect(system), system.get_system_id()
        self._came: queue.SimpleQueue[tuple[int, int, bytes]] = queue.SimpleQueue()
        self._handle = self._direct.subscribe_message("LOG_DATA", self._receive)

    def __enter__(self) -> LogTransfer:
        return self

    def __exit__(self, *_: object) -> None:
        self._direct.unsubscribe_message(self._handle)
        self._send("LOG_REQUEST_END")

    def fetch(self, log: int, size: int, part: Path, stalled_s: float, progress: Callable[[float], None]) -> None:
        """Append to `part` what it lacks of `log`, which has `size` bytes; `progress` is told the share that is there.

        Raises Unavailable if nothing comes for `stalled_s`, OSError if it cannot be written. What `progress` raises
        ends it. `part` keeps what came, up to the last whole chunk.
        """
        with part.open("ab") as file:
            at = min(file.tell(), size) // _BLOCK * _BLOCK
            file.truncate(at)
            while at < size:
                file.write(self._chunk(log, at, min(_CHUNK, size - at), stalled_s, lambda n: progress(n / size)))
                file.flush()
                at = file.tell()
        progress(1.0)

    def _chunk(self, log: int, begin: int, count: int, stalled_s: float, progress: Callable[[int], None]) -> bytes:
        """The bytes of `log` from `begin` on. `progress` is told how many bytes of the log there are so far."""
        end, found = begin + count, {}
        missing, since_s = set(range(begin, end, _BLOCK)), time.monotonic()
        while missing:
            first, *others = sorted(missing)
            last = first
            for at in others:
                if at - last > _BRIDGE:
                    break
                last = at
            self._send("LOG_REQUEST_DATA", id=log, ofs=first, count=min(last + _BLOCK, end) - first)
            for at, data in self._blocks(log, last):
                if at in missing and len(data) == min(_BLOCK, end - at):
                    found[at], since_s = data, time.monotonic()
                    missing.remove(at)
                progress(min(begin + len(found) * _BLOCK, end))
            progress(min(begin + len(found) * _BLOCK, end))  # also while nothing comes: it may end the wait
            if time.monotonic() - since_s > stalled_s:
                raise Unavailable(f"log {log} stopped at byte {begin}: nothing came for {stalled_s:g} s")
        return b"".join(found[at] for at in sorted(found))

    def _blocks(self, log: int, last: int) -> Iterator[tuple[int, bytes]]:
        """Offset and bytes of what comes of `log`, up to the block at `last` or until nothing comes."""
        while True:
            try:
                number, at, data = self._came.get(timeout=_QUIET_S)
            except queue.Empty:
                return
            if number == log:
                yield at, data
                if at == last:
                    return

    def _receive(self, message: MavlinkMessage, _: object) -> None:
        fields = json.loads(message.fields_json)
        self._came.put((fields["id"], fields["ofs"], bytes(fields["data"][: fields["count"]])))

    def _send(self, name: str, **fields: int) -> None:
        body = json.dumps({"target_system": self._system, "target_component": _AUTOPILOT, **fields})
        self._direct.send_message(MavlinkMessage(name, 0, 0, self._system, _AUTOPILOT, body))
