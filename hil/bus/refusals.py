"""What the hub says of clients that it refused at the door, in words: Zenoh tells it in its log only."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path

import zenoh

_LOG = "off,zenoh_link_tls=warn"  # what Zenoh logs; RUST_LOG in the environment asks for more
_AGAIN_S = 60.0  # a client that tries again and again is reported once within this time
_REASONS = (
    ("UnknownIssuer", "its certificate is of another authority"),
    ("BadSignature", "its certificate is of another authority"),
    ("peer sent no certificates", "it has no certificate"),
    ("NotValidYet", "its certificate is not valid yet: compare the clocks of both hosts"),
    ("peer certificate: Expired", "its certificate ran out: make new keys"),
    ("alert: UnknownCA", "it does not accept this hub: its ca.crt is of another authority"),
    ("alert: DecryptError", "it does not accept this hub: its ca.crt is of another authority"),
    ("alert: CertificateExpired", "it does not accept this hub, whose certificate ran out: make new keys"),
    ("alert: BadCertificate", "it does not accept this hub's certificate, which may lack this address"),
    ("corrupt message", "it does not speak TLS: it lacks --keys, or is no client of this bus"),
)
_ESTABLISHED, _LISTENS = "01", "0A"  # states in /proc/net/tcp


def refusal(line: str) -> str:
    """Why a client was refused, from a line of Zenoh's log; empty if the line is about something else."""
    if "zenoh_link_tls" not in line:
        return ""
    return next((words for mark, words in _REASONS if mark in line), "")


def closing_clients(port: int, tables: Sequence[Path] = (Path("/proc/net/tcp"), Path("/proc/net/tcp6"))) -> set[str]:
    """Addresses (host:port) of connections to `port` of this host that are being closed (proc(5))."""
    found: set[str] = set()
    for table in tables:
        with suppress(OSError, ValueError, IndexError):
            for line in table.read_text().splitlines()[1:]:
                local, remote, state = line.split()[1:4]
                if int(local.rpartition(":")[2], 16) == port and state not in (_ESTABLISHED, _LISTENS):
                    host, _, there = remote.partition(":")
                    words = bytes.fromhex(host)
                    packed = b"".join(words[i : i + 4][::-1] for i in range(0, len(words), 4))
                    found.add(f"{ip_address(packed)}:{int(there, 16)}")
    return found


class Refusals:
    """Writes a line for each refused client to standard output. Use as a context manager around the opening of the hub.

    Zenoh writes its log to standard output: it is led through a pipe here, and what else comes is passed on. It does
    not name the client: the kernel does, as long as the connection is being closed.
    """

    def __init__(
        self,
        port: int,
        clock: Callable[[], float] = time.monotonic,
        closing: Callable[[int], set[str]] = closing_clients,
    ) -> None:
        """`port`: the hub's."""
        self._port, self._clock, self._closing = port, clock, closing
        self._seen: set[str] = set()
        self._told: dict[tuple[str, str], float] = {}
        self._out = -1
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def take(self, line: str) -> str:
        """What to write for one line of output; empty for nothing."""
        reason = refusal(line)
        if not reason:
            return "" if " zenoh" in line else line
        closing = self._closing(self._port)
        fresh = sorted(closing - self._seen)
        self._seen = closing
        host = ", ".join(sorted({address.rpartition(":")[0] for address in fresh}))
        now = self._clock()
        if now - self._told.get((host, reason), -_AGAIN_S) < _AGAIN_S:
            return ""
        self._told[host, reason] = now
        return f"perch-hil: hub: refused a client{f' at {host}' if host else ''}: {reason}\n"

    def _serve(self) -> None:
        with os.fdopen(self._read, errors="replace") as lines, suppress(OSError):
            for line in lines:
                os.write(self._out, self.take(line).encode())

    def __enter__(self) -> Refusals:
        os.environ.setdefault("NO_COLOR", "1")
        zenoh.init_log_from_env_or(_LOG)
        self._out = os.dup(1)
        self._read, write = os.pipe2(os.O_CLOEXEC)
        os.set_blocking(write, False)  # the hub never waits for its log
        os.dup2(write, 1)
        os.close(write)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        os.dup2(self._out, 1)  # closes the pipe's last end
        self._thread.join(1.0)
        os.close(self._out)
