"""A byte wire over TCP, as a client (MAVLink over a bridge or router). A stream; it never blocks once connected."""

from __future__ import annotations

import contextlib
import socket

from hil.wires import WireError

BACKLOG = 65536  # bytes waiting to be sent before whole items are dropped


class TcpWire:
    """One connection. A lost one sets `lost` to the reason; there is no reconnection in flight."""

    def __init__(self, host: str, port: int, timeout_s: float = 3.0) -> None:
        """Connect. Raises WireError if there is no answer within `timeout_s`."""
        try:
            self._socket = socket.create_connection((host, port), timeout_s)
        except (OSError, OverflowError) as error:
            raise WireError(f"no answer at TCP {host}:{port} ({error}); is the bridge running there?") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self._name, self._closed, self._out = f"{host}:{port}", False, bytearray()
        self.dropped, self.lost = 0, ""

    def send(self, data: bytes) -> None:
        """Queue `data` whole, or drop and count it, and write what the connection takes now."""
        if self._closed:
            raise WireError("this TCP wire is closed")
        if self.lost or len(self._out) + len(data) > BACKLOG:
            self.dropped += 1
            return
        self._out += data
        self._write()

    def receive(self) -> list[bytes]:
        """Received bytes, in pieces as they came."""
        if self._closed or self.lost:
            return []
        self._write()
        try:
            data = self._socket.recv(65536)
        except (BlockingIOError, InterruptedError):
            return []
        except OSError as error:
            self.lost = f"TCP {self._name} is gone ({error.strerror})"
            return []
        if not data:
            self.lost = f"TCP {self._name} was closed by the other end"
            return []
        return [data]

    def close(self) -> None:
        """Close the connection; may be called twice."""
        self._closed = True
        with contextlib.suppress(OSError):
            self._socket.close()

    def _write(self) -> None:
        while self._out and not self.lost:
            try:
                count = self._socket.send(self._out)
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                self.lost = f"TCP {self._name} is gone ({error.strerror})"
                return
            del self._out[:count]
