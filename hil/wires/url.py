"""Byte wires by address, as a rig writes them.

udp://:14540              listen there; the first sender is the partner (PX4's offboard port)
udp://192.168.1.20:14580  send there from a free port
tcp://192.168.1.20:5760   connect there
serial:///dev/ttyACM0?baud=921600
"""

from __future__ import annotations

from typing import Any
from urllib.parse import parse_qs, urlsplit

from hil.wires import WireError
from hil.wires.serial import SerialWire
from hil.wires.tcp import TcpWire
from hil.wires.udp import UdpWire

KINDS = ("udp", "tcp", "serial")


def check_url(url: str) -> tuple[str, str, int]:
    """(kind, host or device, port or baud). Raises WireError saying what is wrong with `url`."""
    example = "write udp://:14540, tcp://HOST:PORT or serial:///dev/ttyACM0?baud=921600"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError as error:
        raise WireError(f'"{url}": {error}; {example}') from None
    if parts.scheme not in KINDS:
        raise WireError(f'"{url}" is not an address of a wire; {example}')
    if parts.scheme == "serial":
        baud = parse_qs(parts.query).get("baud", ["921600"])[0]
        if not parts.path or not baud.isdecimal():
            raise WireError(f'"{url}" names no serial port or no baud rate; {example}')
        return "serial", parts.path, int(baud)
    if not port or (parts.scheme == "tcp" and not parts.hostname):
        raise WireError(f'"{url}" lacks a host or a port; {example}')
    return parts.scheme, parts.hostname or "", port


def open_url(url: str) -> Any:
    """The byte wire at `url`. Raises WireError if the address is wrong or nothing can be opened there."""
    kind, where, number = check_url(url)
    if kind == "serial":
        return SerialWire(where, number)
    if kind == "tcp":
        return TcpWire(where, number)
    if where:
        return UdpWire(("0.0.0.0", 0), (where, number), partner="fixed")
    return UdpWire(("0.0.0.0", number), partner="first")
