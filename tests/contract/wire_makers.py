"""Two ends of every kind of wire that this machine can run; a kind that it cannot is skipped by name, with why."""

import contextlib
import importlib.util
import os
import socket
import time
import tty
import uuid

import pytest

from hil.contract.wire import memory_pair
from hil.wires import WireError
from hil.wires.can import open_can
from hil.wires.can_udp import CanOverUdp
from hil.wires.serial import SerialWire
from hil.wires.tcp import TcpWire
from hil.wires.udp import UdpWire

LOCAL = "127.0.0.1"
MULTICAST = ("239.74.163.77", 43177)


def udp_pair():
    a = UdpWire((LOCAL, 0))
    b = UdpWire((LOCAL, 0), a.address, partner="fixed")
    b.send(b"first")  # the first sender becomes the partner
    assert collect(a, bool) == [b"first"]
    return a, b


class _Pty:
    """The far end of a serial port: a pseudo terminal's master, with a wire's methods."""

    def __init__(self):
        self.master, self._slave = os.openpty()
        tty.setraw(self.master)
        os.set_blocking(self.master, False)
        self.name = os.ttyname(self._slave)

    def send(self, data):
        os.write(self.master, data)

    def receive(self):
        try:
            return [os.read(self.master, 65536)]
        except BlockingIOError:
            return []

    def close(self):
        for fd in (self.master, self._slave):
            with contextlib.suppress(OSError):
                os.close(fd)


def serial_pair():
    far = _Pty()
    return SerialWire(far.name, 115200), far


def tcp_pair():
    with socket.create_server((LOCAL, 0)) as server:
        near = TcpWire(LOCAL, server.getsockname()[1])
        far = server.accept()[0]
    return near, _Peer(far)


class _Peer:
    """The other end of a TCP connection, with a wire's methods."""

    def __init__(self, connection):
        self._socket = connection
        connection.setblocking(False)

    def send(self, data):
        self._socket.sendall(data)

    def receive(self):
        try:
            data = self._socket.recv(65536)
        except BlockingIOError:
            return []
        return [data] if data else []

    def close(self):
        self._socket.close()


def can_over_udp():
    a, b = udp_pair()
    return CanOverUdp(a), CanOverUdp(b)


def memory():
    return memory_pair(lambda: 0)


def can_virtual():
    channel = uuid.uuid4().hex
    return open_can("virtual", channel), open_can("virtual", channel)


def can_udp_multicast():
    if importlib.util.find_spec("msgpack") is None:
        pytest.skip("CAN udp_multicast: python-can needs the package msgpack for it, which is not installed")
    try:
        return tuple(open_can("udp_multicast", MULTICAST[0], port=MULTICAST[1]) for _ in range(2))
    except WireError as error:
        pytest.skip(f"CAN udp_multicast: {error}")


def can_socketcan():
    try:
        return open_can("socketcan", "vcan0"), open_can("socketcan", "vcan0")
    except WireError as error:
        pytest.skip(f"CAN socketcan: {error}")


BYTE_KINDS = {"memory": memory, "udp": udp_pair, "tcp": tcp_pair, "serial": serial_pair}
CAN_KINDS = {
    "memory": memory,
    "can over udp": can_over_udp,
    "can virtual": can_virtual,
    "can udp_multicast": can_udp_multicast,
    "can socketcan": can_socketcan,
}


def opened(make):
    ends = make()
    yield ends
    for end in ends:
        end.close()
        end.close()  # may be called twice


def collect(end, enough, limit_s=2.0):
    """Items received until `enough(items)`, or what came within the limit."""
    items, until = [], time.monotonic() + limit_s
    while True:
        items += end.receive()
        if enough(items) or time.monotonic() > until:
            return items
        time.sleep(0.001)


def collect_bytes(end, count):
    """Pieces of a stream, `count` bytes or what came within the limit."""
    return collect(end, lambda got: sum(map(len, got)) >= count)


def nothing_comes(end):
    time.sleep(0.02)
    return end.receive() == []
