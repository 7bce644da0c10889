"""The firmware's simulator link: addresses, the server, waiting, and leaving."""

import socket
import threading
import time

import pytest

from hil.wires import WireError, simulator
from hil.wires.simulator import SimulatorServer, check_simulator


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.fixture
def joined():
    """A server and the firmware's end."""
    port = free_port()
    server = SimulatorServer(port=port)
    client = socket.create_connection(("127.0.0.1", port))
    server.accept(5.0)
    yield server, client
    client.close()
    server.close()


@pytest.mark.parametrize(
    ("url", "found"),
    [
        ("tcp://:4560", ("tcp", "127.0.0.1", 4560)),
        ("tcp://0.0.0.0:4561", ("tcp", "0.0.0.0", 4561)),
        ("serial:///dev/ttyACM0?baud=57600", ("serial", "/dev/ttyACM0", 57600)),
    ],
)
def test_addresses_are_read(url, found):
    assert check_simulator(url) == found


@pytest.mark.parametrize("url", ["udp://:4560", "tcp://:0", "tcp://:99999", "tcp://", "4560", "serial://", ""])
def test_other_addresses_are_refused_with_an_example(url):
    with pytest.raises(WireError, match=r"tcp://:4560|serial:///dev"):
        check_simulator(url)


def test_port_in_use_is_told():
    port = free_port()
    first = SimulatorServer(port=port)
    with pytest.raises(WireError, match=f"TCP port {port} on 127.0.0.1 is in use"):
        SimulatorServer(port=port)
    first.close()


def test_bytes_go_both_ways(joined):
    server, client = joined
    server.send(b"sensors")
    assert client.recv(100) == b"sensors"
    client.sendall(b"controls")
    assert server.receive() == [b"controls"]


def test_firmware_that_says_nothing_is_waited_for_a_moment(joined, monkeypatch):
    server, client = joined
    monkeypatch.setattr(simulator, "PATIENCE_S", 0.2)
    began = time.monotonic()
    assert server.receive() == []
    assert time.monotonic() - began < 0.15, "short before its first controls"
    server.mark_answered(True)
    began = time.monotonic()
    assert server.receive() == []
    assert time.monotonic() - began > 0.15
    threading.Timer(0.05, client.sendall, (b"late",)).start()
    assert server.receive() == [b"late"]


def test_firmware_that_never_joins_or_ends_is_told():
    server = SimulatorServer(port=free_port())
    with pytest.raises(WireError, match=r"no firmware joined .* within 0\.1 s"):
        server.accept(0.1)
    with pytest.raises(WireError, match="it has ended"):
        server.accept(5.0, lambda: "it has ended")
    with pytest.raises(WireError, match="no firmware has joined"):
        server.send(b"x")
    server.close()


def test_firmware_that_leaves_is_told(joined):
    server, client = joined
    client.close()
    with pytest.raises(WireError, match="has left"):
        server.receive()
    with pytest.raises(WireError, match="is gone"):
        for _ in range(100):
            server.send(bytes(1000))
