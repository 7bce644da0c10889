"""MAVLink's byte wires by address, as a rig writes them.

udp://:14540              listen there, as udp://0.0.0.0:14540 and udpin://0.0.0.0:14540 do (PX4's offboard port)
udp://192.168.1.20:14580  send there from a free port, as udpout://192.168.1.20:14580 does
tcp://192.168.1.20:5760   connect there
serial:///dev/ttyACM0?baud=921600

`udpin:` and `udpout:` may be written without slashes, as in pymavlink.
"""

from __future__ import annotations

import re
from typing import Any
from urllib.parse import parse_qs, urlsplit

from hil.wires import WireError
from hil.wires.serial import SerialWire
from hil.wires.tcp import TcpWire
from hil.wires.udp import UdpWire
from vehicle.px4.codec import Parser

KINDS = ("udp", "udpin", "udpout", "tcp", "serial")
_ANY = "0.0.0.0"
_EXAMPLE = "write udp://:14540, udpin://0.0.0.0:14540, tcp://HOST:PORT or serial:///dev/ttyACM0?baud=921600"


def check_url(url: str) -> tuple[str, str, int]:
    """(udpin, udpout, tcp or serial; host or device; port or baud). Raises WireError: what is wrong with `url`."""
    text = re.sub(r"^(udp|udpin|udpout|tcp):(?!//)", r"\1://", url)
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError as error:
        raise WireError(f'"{url}": {error}; {_EXAMPLE}') from None
    if parts.scheme not in KINDS:
        raise WireError(f'"{url}" is not an address of a wire; {_EXAMPLE}')
    if parts.scheme == "serial":
        baud = parse_qs(parts.query).get("baud", ["921600"])[0]
        if not parts.path or not baud.isdecimal():
            raise WireError(f'"{url}" names no serial port or no baud rate; {_EXAMPLE}')
        return "serial", parts.path, int(baud)
    host, kind = parts.hostname or "", parts.scheme
    if kind == "udp":
        kind = "udpin" if host in ("", _ANY) else "udpout"
    if not port or (kind != "udpin" and host in ("", _ANY)):
        raise WireError(f'"{url}" lacks a host or a port; {_EXAMPLE}')
    return kind, host or _ANY, port


def open_url(url: str, system: int | None = None) -> Any:
    """The byte wire at `url`. Raises WireError if the address is wrong or nothing can be opened there.

    A wire that listens belongs to the sender of the first datagram with a valid MAVLink frame (of `system`, if given).
    """
    kind, where, number = check_url(url)
    if kind == "serial":
        return SerialWire(where, number)
    if kind == "tcp":
        return TcpWire(where, number)
    if kind == "udpout":
        return UdpWire((_ANY, 0), (where, number), partner="fixed")
    return UdpWire((where, number), partner="first", qualifies=lambda data: carries_mavlink(data, system))


def carries_mavlink(datagram: bytes, system: int | None) -> bool:
    """True if a valid MAVLink frame, of `system` if given, lies whole in the datagram."""
    return any(system in (None, frame.system) for frame in Parser().feed(datagram))
