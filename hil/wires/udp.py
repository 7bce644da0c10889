"""A byte wire over UDP. It never blocks and raises nothing in flight: failed and refused datagrams are counted."""

from __future__ import annotations

import errno
import socket
from collections.abc import Callable
from typing import Literal

from hil.wires import WireError

Address = tuple[str, int]
Partner = Literal["fixed", "first", "last"]

_DATAGRAM = 65536
_AT_ONCE = 1024  # datagrams taken in one `receive`, so that a flood cannot delay a control loop


class UdpWire:
    """One UDP socket and one partner.

    `partner` selects where datagrams are sent:
    - "fixed": always to `peer`.
    - "first": to `peer` (if given) until a datagram comes, then to its sender for the life of the wire, as PX4 does.
    - "last": to the sender of the last datagram.

    With `accept_others` False, datagrams of other senders than the partner are dropped and counted in
    `others_dropped`; with True they are received, as PX4 does. With `qualifies`, the first partner is the sender of a
    datagram for which it is True; others before it are dropped and counted.
    """

    def __init__(
        self,
        bind: Address,
        peer: Address | None = None,
        *,
        partner: Partner = "first",
        accept_others: bool = False,
        qualifies: Callable[[bytes], bool] | None = None,
    ) -> None:
        """Bind to `bind` (port 0: any free one, see `address`). Raises WireError if that is not possible."""
        if partner == "fixed" and peer is None:
            raise WireError("a UDP wire with a fixed partner needs the peer's host and port")
        if partner not in ("fixed", "first", "last"):
            raise WireError(f'UDP partner rule "{partner}" is unknown: use "fixed", "first" or "last"')
        self._partner_rule, self._accept_others = partner, accept_others
        self._peer = _resolve(peer) if peer else None
        self._settled, self._qualifies = partner == "fixed", qualifies
        self._closed = False
        self.others_dropped = self.send_errors = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind(_resolve(bind))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise WireError(_bind_error(bind, error)) from None

    @property
    def address(self) -> Address:
        """This end's own address."""
        host, port = self._socket.getsockname()
        return host, port

    @property
    def peer(self) -> Address | None:
        """Where datagrams are sent now; None while no partner is known."""
        return self._peer

    def send(self, data: bytes) -> bool:
        """One datagram to the partner. False, counted in `send_errors`, without a partner or if the network refuses."""
        if self._closed:
            raise WireError("this UDP wire is closed")
        if self._peer is None:
            self.send_errors += 1
            return False
        try:
            self._socket.sendto(data, self._peer)
        except OSError:
            self.send_errors += 1
            return False
        return True

    def receive(self) -> list[bytes]:
        """Datagrams that have come, oldest first; at most 1024, the rest stays for the next call."""
        items: list[bytes] = []
        if self._closed:
            return items
        for _ in range(_AT_ONCE):
            try:
                data, sender = self._socket.recvfrom(_DATAGRAM)
            except (BlockingIOError, InterruptedError):
                break
            except OSError:  # an ICMP answer to something sent earlier
                continue
            if self._accept(sender, data):
                items.append(data)
        return items

    def fileno(self) -> int:
        """The socket's descriptor, to wait for what comes."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the port; may be called twice."""
        self._closed = True
        self._socket.close()

    def _accept(self, sender: Address, data: bytes) -> bool:
        if self._partner_rule == "last":
            self._peer = sender
            return True
        if not self._settled and (self._qualifies is None or self._qualifies(data)):
            self._peer, self._settled = sender, True
            return True
        if (self._settled and sender == self._peer) or self._accept_others:
            return True
        self.others_dropped += 1
        return False


def _resolve(address: Address) -> Address:
    host, port = address
    try:
        found = socket.getaddrinfo(host or "0.0.0.0", None, socket.AF_INET, socket.SOCK_DGRAM)
    except OSError as error:
        raise WireError(f'"{host}" is not a host this machine can find ({error.strerror or error})') from None
    return str(found[0][4][0]), port


def _bind_error(bind: Address, error: Exception) -> str:
    host, port = bind
    what = f"UDP port {port} on {host or '0.0.0.0'}"
    number = error.errno if isinstance(error, OSError) else None
    if number == errno.EADDRINUSE:
        return (
            f"{what} is in use: another program listens there (a second run, QGroundControl, MAVSDK); "
            "stop it, or give the wire another port"
        )
    if number == errno.EADDRNOTAVAIL:
        return f"{what} cannot be bound: no interface of this machine has that address"
    if number == errno.EACCES:
        return f"{what} cannot be bound: ports below 1024 need privileges; choose a higher one"
    return f"{what} cannot be bound: {error}"
