"""Partners of a UDP wire: the rules that choose one, and datagrams that are ignored."""

import contextlib
import socket

import pytest

from hil.wires import WireError
from hil.wires.udp import UdpWire
from tests.contract.wire_makers import LOCAL, collect, nothing_comes


def at(port_wire):
    return port_wire.address


def test_udp_keeps_its_first_partner_as_px4_does():
    with contextlib.ExitStack() as stack:
        default, first, second = (UdpWire((LOCAL, 0)) for _ in range(3))
        px4 = UdpWire((LOCAL, 0), at(default), partner="first", accept_others=True)
        for wire in (default, first, second, px4):
            stack.callback(wire.close)
        px4.send(b"telemetry")  # PX4 sends first, without having received anything
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


def test_client_drops_and_counts_other_senders():
    with contextlib.ExitStack() as stack:
        client = UdpWire((LOCAL, 0), partner="first")
        px4 = UdpWire((LOCAL, 0), at(client), partner="fixed")
        stranger = UdpWire((LOCAL, 0), at(client), partner="fixed")
        for wire in (client, px4, stranger):
            stack.callback(wire.close)
        client.send(b"no partner yet")
        assert client.send_errors == 1
        px4.send(b"hello")
        assert collect(client, bool) == [b"hello"]
        stranger.send(b"arm!")
        assert nothing_comes(client)
        assert client.others_dropped == 1
        client.send(b"hi")
        assert collect(px4, bool) == [b"hi"]


def test_udp_rule_last_sends_to_the_last_sender():
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


def test_udp_port_in_use_error_names_the_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((LOCAL, 0))
        with pytest.raises(WireError, match=f"UDP port {other.getsockname()[1]} on 127.0.0.1 is in use"):
            UdpWire((LOCAL, other.getsockname()[1]))


def test_udp_send_to_an_absent_partner_does_not_raise():
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
def test_invalid_udp_wires_raise_with_the_reason(arguments, options, text):
    with pytest.raises(WireError, match=text):
        UdpWire(*arguments, **options)
