"""One suite over every kind of wire that this machine can run; a kind that it cannot is skipped by name, with why."""

import contextlib
import importlib.util
import os
import socket
import termios
import time
import tty
import uuid

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.wire import CanFrame, memory_pair
from hil.wires import WireError
from hil.wires.can import PythonCanWire, open_can
from hil.wires.can_udp import CanOverUdp
from hil.wires.serial import BACKLOG, SerialWire
from hil.wires.tcp import TcpWire
from hil.wires.udp import UdpWire
from hil.wires.url import check_url, open_url

LOCAL = "127.0.0.1"
MULTICAST = ("239.74.163.77", 43177)


def udp_pair():
    a = UdpWire((LOCAL, 0))
    b = UdpWire((LOCAL, 0), a.address, partner="fixed")
    b.send(b"who is here")  # the first one heard becomes the partner
    assert collect(a, bool) == [b"who is here"]
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


@pytest.fixture(params=BYTE_KINDS)
def byte_ends(request):
    yield from opened(BYTE_KINDS[request.param])


@pytest.fixture(params=CAN_KINDS)
def can_ends(request):
    yield from opened(CAN_KINDS[request.param])


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


# bytes


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(items=st.lists(st.binary(min_size=1, max_size=280), min_size=1, max_size=20))
def test_bytes_arrive_whole_and_in_order_both_ways(byte_ends, items):
    for sender, receiver in (byte_ends, byte_ends[::-1]):
        for item in items:
            sender.send(item)
        assert b"".join(collect_bytes(receiver, sum(map(len, items)))) == b"".join(items)


@pytest.mark.parametrize("kind", ["memory", "udp"])
def test_datagrams_keep_their_borders(kind):
    for ends in opened(BYTE_KINDS[kind]):
        for item in (b"one", b"", b"three" * 40):
            ends[0].send(item)
        assert collect(ends[1], lambda got: len(got) == 3) == [b"one", b"", b"three" * 40]


def test_bytes_are_never_echoed_and_receive_never_waits(byte_ends):
    a, b = byte_ends
    start = time.monotonic()
    for _ in range(200):
        assert a.receive() == []
    assert time.monotonic() - start < 0.5
    a.send(b"hello")
    assert collect(b, bool) == [b"hello"]
    assert nothing_comes(a)


@pytest.mark.parametrize("kind", BYTE_KINDS)
def test_a_closed_byte_wire_gives_nothing(kind):
    for a, b in opened(BYTE_KINDS[kind]):
        b.send(b"late")
        a.close()
        assert a.receive() == []
        if kind != "memory":
            with pytest.raises(WireError, match="closed"):
                a.send(b"x")


# CAN


frames = st.builds(CanFrame, st.integers(0, 0x7FF), st.binary(max_size=8))


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sent=st.lists(frames, min_size=1, max_size=20))
def test_frames_arrive_in_order_both_ways_and_never_come_back(can_ends, sent):
    for sender, receiver in (can_ends, can_ends[::-1]):
        for frame in sent:
            sender.send(frame)
        received = collect(receiver, lambda got: len(got) >= len(sent))
        assert received == sent
        assert all(isinstance(frame, CanFrame) for frame in received)
        assert sender.receive() == []


def test_equal_frames_of_both_ends_are_told_apart(can_ends):
    a, b = can_ends
    same = CanFrame(0x111, bytes(8))
    a.send(same)
    b.send(same)
    assert collect(a, bool) == [same]
    assert collect(b, bool) == [same]
    assert nothing_comes(a)
    assert nothing_comes(b)


def test_what_is_no_standard_data_frame_is_counted_not_delivered():
    channel = uuid.uuid4().hex
    with can.Bus(interface="virtual", channel=channel) as raw:
        wire = open_can("virtual", channel)
        raw.send(can.Message(arbitration_id=0x111, is_extended_id=True, data=b"x"))
        raw.send(can.Message(arbitration_id=0x111, is_extended_id=False, is_remote_frame=True, dlc=8))
        raw.send(can.Message(arbitration_id=0x111, is_extended_id=False, data=b"y"))
        assert collect(wire, bool) == [CanFrame(0x111, b"y")]
        assert wire.rejected == 2
        wire.close()


@pytest.mark.parametrize("frame", [CanFrame(0x800, b""), CanFrame(-1, b""), CanFrame(1, bytes(9))])
def test_impossible_frames_are_refused(frame):
    for a, _ in opened(can_virtual):
        with pytest.raises(ValueError, match="11-bit"):
            a.send(frame)


class _DeadBus(can.BusABC):
    """A bus whose adapter has been pulled."""

    def __init__(self):
        super().__init__("dead")

    def send(self, msg, timeout=None):
        raise can.CanOperationError("no buffer space available")

    def _recv_internal(self, timeout):
        raise can.CanOperationError("network is down")


def test_a_dead_bus_is_counted_and_does_not_raise():
    wire = PythonCanWire(_DeadBus())
    wire.send(CanFrame(0x111, b""))
    assert wire.receive() == []
    assert (wire.send_errors, wire.rejected) == (1, 1)
    wire.close()


def test_unusable_can_buses_say_how_to_mend_it():
    with pytest.raises(WireError, match=r"python-can knows .*socketcan"):
        open_can("soketcan", "can0")
    with pytest.raises(WireError, match="ip link set can77 up"):
        open_can("socketcan", "can77")


# UDP's partner rules


def at(port_wire):
    return port_wire.address


def test_the_first_partner_is_kept_as_px4_keeps_it():
    with contextlib.ExitStack() as stack:
        default, first, second = (UdpWire((LOCAL, 0)) for _ in range(3))
        px4 = UdpWire((LOCAL, 0), at(default), partner="first", strangers=True)
        for wire in (default, first, second, px4):
            stack.callback(wire.close)
        px4.send(b"telemetry")  # PX4 speaks first, without having heard anything
        assert collect(default, bool) == [b"telemetry"]
        first._peer = second._peer = at(px4)
        first.send(b"1")
        assert collect(px4, bool) == [b"1"]
        second.send(b"2")
        assert collect(px4, bool) == [b"2"]  # processed, but answered to the first
        px4.send(b"answer")
        assert collect(first, bool) == [b"answer"]
        assert nothing_comes(second)
        assert px4.peer == at(first)


def test_a_client_drops_strangers_and_counts_them():
    with contextlib.ExitStack() as stack:
        client = UdpWire((LOCAL, 0), partner="first")
        px4 = UdpWire((LOCAL, 0), at(client), partner="fixed")
        stranger = UdpWire((LOCAL, 0), at(client), partner="fixed")
        for wire in (client, px4, stranger):
            stack.callback(wire.close)
        client.send(b"nobody is there yet")
        assert client.send_errors == 1
        px4.send(b"hello")
        assert collect(client, bool) == [b"hello"]
        stranger.send(b"arm!")
        assert nothing_comes(client)
        assert client.strangers_dropped == 1
        client.send(b"hi")
        assert collect(px4, bool) == [b"hi"]


def test_the_last_partner_is_followed():
    with contextlib.ExitStack() as stack:
        hub = UdpWire((LOCAL, 0), partner="last")
        one, two = (UdpWire((LOCAL, 0), at(hub), partner="fixed") for _ in range(2))
        for wire in (hub, one, two):
            stack.callback(wire.close)
        for wire in (one, two):
            wire.send(b"x")
            assert collect(hub, bool) == [b"x"]
            hub.send(b"y")
            assert collect(wire, bool) == [b"y"]


def test_a_port_in_use_is_named():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((LOCAL, 0))
        with pytest.raises(WireError, match=f"UDP port {other.getsockname()[1]} on 127.0.0.1 is in use"):
            UdpWire((LOCAL, other.getsockname()[1]))


def test_a_partner_that_is_not_there_does_not_raise():
    gone = UdpWire((LOCAL, 0))
    gone.close()
    wire = UdpWire((LOCAL, 0), (LOCAL, 9), partner="fixed")
    for _ in range(3):
        wire.send(b"x")
        assert wire.receive() == []
    wire.close()


@pytest.mark.parametrize(
    ("arguments", "options", "text"),
    [
        (((LOCAL, 0),), {"partner": "fixed"}, "needs the peer"),
        (((LOCAL, 0),), {"partner": "newest"}, '"first" or "last"'),
        (((LOCAL, 70000),), {}, "UDP port 70000"),
        (((LOCAL, 0), ("no such host.invalid", 1)), {}, "not a host"),
        ((("192.0.2.1", 0),), {}, "no interface of this machine"),
    ],
)
def test_impossible_udp_wires_say_why(arguments, options, text):
    with pytest.raises(WireError, match=text):
        UdpWire(*arguments, **options)


# serial


def test_a_serial_port_is_raw():
    for near, far in opened(serial_pair):
        every = bytes(range(256))
        far.send(every)
        assert b"".join(collect_bytes(near, 256)) == every
        near.send(every)
        assert b"".join(collect_bytes(far, 256)) == every
        mode = termios.tcgetattr(near._fd)
        assert mode[0] & (termios.IXON | termios.ICRNL) == 0
        assert mode[3] & (termios.ECHO | termios.ICANON) == 0


def test_a_stuck_serial_port_drops_whole_items():
    for near, far in opened(serial_pair):
        item = bytes(range(200))
        while not near.dropped:
            near.send(item)
        assert len(near._out) <= BACKLOG
        until, got = time.monotonic() + 2.0, b""
        while near._out and time.monotonic() < until:
            got += b"".join(far.receive())
            near.receive()
        got += b"".join(collect(far, lambda _: False, 0.05))
        assert len(got) % len(item) == 0
        assert got == item * (len(got) // len(item))


def test_a_pulled_plug_is_told_not_raised():
    near, far = serial_pair()
    far.close()
    near.send(b"x")
    near.receive()
    assert "gone" in near.lost
    near.send(b"y")
    assert near.dropped == 1
    near.close()


def test_serial_troubles_say_how_to_mend_them(tmp_path):
    with pytest.raises(WireError, match="there is no serial port /dev/ttyACM77; plugged in now"):
        SerialWire("/dev/ttyACM77")
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(WireError, match="not a serial port"):
        SerialWire(file)
    with pytest.raises(WireError, match=r"57600.*921600"):
        SerialWire("/dev/ttyACM0", 12345)
    near, far = serial_pair()
    with pytest.raises(WireError, match="in use"):
        SerialWire(far.name)
    near.close()
    far.close()


# TCP, addresses, frames over UDP


def test_tcp_troubles_are_told_not_raised():
    with socket.create_server((LOCAL, 0)) as server:
        port = server.getsockname()[1]
        wire = TcpWire(LOCAL, port)
        server.accept()[0].close()
    collect(wire, lambda _: bool(wire.lost))
    assert "closed by the other end" in wire.lost
    wire.send(b"x")
    assert wire.dropped == 1
    wire.close()
    with pytest.raises(WireError, match=f"nobody answers at TCP 127.0.0.1:{port}"):
        TcpWire(LOCAL, port)


def test_no_frame_over_udp_is_counted():
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
        ("udp://:14540", ("udp", "", 14540)),
        ("udp://10.0.0.7:14580", ("udp", "10.0.0.7", 14580)),
        ("tcp://localhost:5760", ("tcp", "localhost", 5760)),
        ("serial:///dev/ttyACM0", ("serial", "/dev/ttyACM0", 921600)),
        ("serial:///dev/ttyUSB1?baud=57600", ("serial", "/dev/ttyUSB1", 57600)),
    ],
)
def test_addresses_of_wires(url, parts):
    assert check_url(url) == parts


@pytest.mark.parametrize("url", ["", "14540", "udp://", "tcp://:5760", "udp://:99999", "serial://", "http://a:1"])
def test_wrong_addresses_show_right_ones(url):
    with pytest.raises(WireError, match="udp://:14540"):
        check_url(url)


def test_a_wire_by_its_address():
    listener = UdpWire((LOCAL, 0))
    caller = open_url(f"udp://{LOCAL}:{listener.address[1]}")
    caller.send(b"hello")
    assert collect(listener, bool) == [b"hello"]
    for wire in (listener, caller):
        wire.close()
