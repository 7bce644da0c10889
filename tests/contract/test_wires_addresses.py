"""TCP's troubles, CAN frames over UDP, and wires by their addresses."""

import socket

import pytest

from hil.contract.wire import CanFrame
from hil.wires import WireError
from hil.wires.can_udp import CanOverUdp
from hil.wires.tcp import TcpWire
from hil.wires.udp import UdpWire
from hil.wires.url import check_url, open_url
from tests.contract.wire_makers import LOCAL, collect, udp_pair
from vehicle.px4.codec import Packer


def test_tcp_errors_are_reported_not_raised():
    with socket.create_server((LOCAL, 0)) as server:
        port = server.getsockname()[1]
        wire = TcpWire(LOCAL, port)
        server.accept()[0].close()
    collect(wire, lambda _: bool(wire.lost))
    assert "closed by the other end" in wire.lost
    wire.send(b"x")
    assert wire.dropped == 1
    wire.close()
    with pytest.raises(WireError, match=f"no answer at TCP 127.0.0.1:{port}"):
        TcpWire(LOCAL, port)


def test_udp_datagram_without_a_can_frame_is_counted():
    a, b = udp_pair()
    wire = CanOverUdp(b)
    for item in (b"", b"\x01", b"\x08\x00", bytes(11), b"\x01\x11ok"):
        a.send(item)
    assert collect(wire, bool) == [CanFrame(0x111, b"ok")]
    assert wire.rejected == 4
    for end in (a, wire):
        end.close()


@pytest.mark.parametrize(
    ("url", "parts"),
    [
        ("udp://:14540", ("udpin", "0.0.0.0", 14540)),
        ("udp://0.0.0.0:14540", ("udpin", "0.0.0.0", 14540)),
        ("udpin://0.0.0.0:14540", ("udpin", "0.0.0.0", 14540)),
        ("udpin:127.0.0.1:14540", ("udpin", "127.0.0.1", 14540)),
        ("udp://10.0.0.7:14580", ("udpout", "10.0.0.7", 14580)),
        ("udpout:10.0.0.7:14580", ("udpout", "10.0.0.7", 14580)),
        ("tcp://localhost:5760", ("tcp", "localhost", 5760)),
        ("serial:///dev/ttyACM0", ("serial", "/dev/ttyACM0", 921600)),
        ("serial:///dev/ttyUSB1?baud=57600", ("serial", "/dev/ttyUSB1", 57600)),
    ],
)
def test_wire_addresses_are_parsed(url, parts):
    assert check_url(url) == parts


@pytest.mark.parametrize(
    "url",
    [
        "",
        "14540",
        "udp://",
        "tcp://:5760",
        "udp://:99999",
        "serial://",
        "http://a:1",
        "udpout://:1",
        "udpout:0.0.0.0:1",
    ],
)
def test_wrong_addresses_raise_with_an_example(url):
    with pytest.raises(WireError, match="udp://:14540"):
        check_url(url)


def test_wire_is_opened_by_its_address():
    listener = UdpWire((LOCAL, 0))
    caller = open_url(f"udp://{LOCAL}:{listener.address[1]}")
    caller.send(b"hello")
    assert collect(listener, bool) == [b"hello"]
    for wire in (listener, caller):
        wire.close()


def test_listening_wire_belongs_to_the_first_valid_frame_of_the_wanted_system():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOCAL, 0))
        port = probe.getsockname()[1]
    ours = open_url(f"udpin:{LOCAL}:{port}", system=3)
    scanner, station, autopilot = (UdpWire((LOCAL, 0), (LOCAL, port), partner="fixed") for _ in range(3))
    beat = (2, 12, 0, 0, 4, 3)
    good = Packer(3, 1).send_name("HEARTBEAT", *beat)
    for item in (b"", b"GET / HTTP/1.1", good[:-1] + bytes((good[-1] ^ 1,))):
        scanner.send(item)
    station.send(Packer(255, 190).send_name("HEARTBEAT", *beat))
    autopilot.send(good)
    assert collect(ours, bool) == [good]
    assert ours.others_dropped == 4
    scanner.send(good)
    autopilot.send(good)
    assert collect(ours, bool) == [good]
    ours.send(b"answer")
    assert collect(autopilot, bool) == [b"answer"]
    for wire in (ours, scanner, station, autopilot):
        wire.close()
