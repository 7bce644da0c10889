"""The firmware's simulator link: a TCP server that a firmware in lockstep joins, or a flight controller's serial port.

tcp://:4560                        listen there, where PX4's SITL looks for its simulator (4560 + instance)
serial:///dev/ttyACM0?baud=921600  the flight controller's USB port
"""

from __future__ import annotations

import contextlib
import errno
import re
import select
import socket
import time
from collections.abc import Callable
from urllib.parse import urlsplit

from hil.wires import WireError
from hil.wires.serial import SerialWire
from hil.wires.url import check_url

PORT = 4560
CONNECT_S = 30.0
PATIENCE_S = 0.5  # for one answer; a busy machine may take tens of milliseconds
BOOT_PATIENCE_S = 0.02  # the same before the first answer, while the firmware starts its modules
_EXAMPLE = "write tcp://:4560 (a firmware joins there) or serial:///dev/ttyACM0?baud=921600"


def check_simulator(url: str) -> tuple[str, str, int]:
    """(tcp or serial; host to listen on or device; port or baud). Raises WireError: what is wrong with `url`."""
    if url.startswith("serial:"):
        return check_url(url)
    match = re.fullmatch(r"tcp://([^/:]*):(\d{1,5})", url)
    port = int(match[2]) if match else 0
    if not match or not 1 <= port <= 65535 or urlsplit(url).query:
        raise WireError(f'"{url}" is no address of a simulator link; {_EXAMPLE}')
    return "tcp", match[1] or "127.0.0.1", port


class SimulatorServer:
    """Waits for one firmware and exchanges bytes with it in lockstep: `receive` waits for the firmware's answer."""

    lockstep = True

    def __init__(self, host: str = "127.0.0.1", port: int = PORT) -> None:
        """Listen. Raises WireError for a port that is in use or may not be bound."""
        self._name, self._client = f"TCP port {port} on {host}", None
        self._patience_s = BOOT_PATIENCE_S
        self.relaunch: Callable[[], None] | None = None  # starts its firmware anew, where the run has started it
        self._server = socket.socket()
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._server.bind((host, port))
            self._server.listen(1)
        except OSError as error:
            self._server.close()
            why = "is in use: another simulator listens there; stop it" if error.errno == errno.EADDRINUSE else ""
            raise WireError(f"{self._name} {why or f'cannot be bound ({error.strerror})'}") from None
        self._server.setblocking(False)
        self._client: socket.socket | None

    def accept(self, limit_s: float = CONNECT_S, ended: Callable[[], str] = lambda: "") -> None:
        """Wait for the firmware. Raises WireError if none comes within `limit_s`, or with what `ended` says."""
        until = time.monotonic() + limit_s
        while not select.select([self._server], [], [], 0.1)[0]:
            why = ended()
            if why:
                raise WireError(why)
            if time.monotonic() > until:
                raise WireError(
                    f"no firmware joined {self._name} within {limit_s:g} s: start PX4's SITL with the model none_iris"
                )
        if self._client is not None:
            self._client.close()
        self._client, _ = self._server.accept()
        self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client.settimeout(CONNECT_S)

    def send(self, data: bytes) -> None:
        """Send `data`. Raises WireError if the firmware has left or takes nothing."""
        if self._client is None:
            raise WireError(f"no firmware has joined at {self._name}")
        try:
            self._client.sendall(data)
        except OSError as error:
            raise WireError(f"the firmware at {self._name} is gone ({error.strerror or error})") from None

    def receive(self) -> list[bytes]:
        """What the firmware sent, once something has come; empty after waiting in vain. Raises WireError if it has
        left."""
        assert self._client is not None
        if not select.select([self._client], [], [], self._patience_s)[0]:
            return []
        try:
            data = self._client.recv(65536)
        except OSError as error:
            raise WireError(f"the firmware at {self._name} is gone ({error.strerror or error})") from None
        if not data:
            raise WireError(f"the firmware at {self._name} has left: see its log in the run's folder")
        return [data]

    def mark_answered(self, answered: bool) -> None:
        """Whether controls have come: before, the firmware still starts its modules."""
        self._patience_s = PATIENCE_S if answered else BOOT_PATIENCE_S

    def restart(self) -> None:
        """End the firmware as a loss of power does, and wait until it has joined anew. Raises WireError."""
        if self.relaunch is None:
            raise WireError(f"the firmware at {self._name} was not started by this run and cannot be restarted by it")
        self.relaunch()

    def close(self) -> None:
        """Close both sockets; may be called twice."""
        for one in (self._client, self._server):
            if one is not None:
                with contextlib.suppress(OSError):
                    one.close()


class SimulatorPort(SerialWire):
    """The serial port of a flight controller in HITL mode: real time, nothing waits."""

    lockstep = False

    def mark_answered(self, answered: bool) -> None:
        """Nothing waits."""

    def restart(self) -> None:
        """Raises WireError: a controller has no switch here."""
        raise WireError("a flight controller cannot be restarted from here")
