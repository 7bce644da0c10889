"""Addresses of a Crazyflie, and cflib's link driver as a wire."""

import time

import pytest

from hil.wires import WireError
from hil.wires.crazyradio import CrazyradioWire, check_radio
from hil.wires.udp import UdpWire

LIMIT_S = 30.0


@pytest.mark.parametrize("url", ["radio://0/80/2M/E7E7E7E7E7", "radio://0/125/250K/01", "udp://127.0.0.1:19850"])
def test_address_of_a_crazyflie_is_accepted(url):
    check_radio(url)


@pytest.mark.parametrize(
    "url",
    [
        "",
        "radio://",
        "radio://0/126/2M/E7E7E7E7E7",
        "radio://0/80/3M/E7E7E7E7E7",
        "udp://host:0",
        "tcp://host:1",
        "usb://0",
    ],
)
def test_other_address_is_refused_with_an_example(url):
    with pytest.raises(WireError, match="radio://0/80/2M/E7E7E7E7E7"):
        check_radio(url)


def test_radio_that_is_not_there_is_told():
    with pytest.raises(WireError, match=r"cannot be opened: .*; is the Crazyradio plugged in"):
        CrazyradioWire("radio://9/80/2M/E7E7E7E7E7")


def test_packets_pass_both_ways_through_cflib():
    theirs = UdpWire(("127.0.0.1", 0), partner="last")
    ours = CrazyradioWire(f"udp://127.0.0.1:{theirs.address[1]}")
    try:
        assert ours.send(b"\xfd\x01\x02")
        assert received(theirs) == [b"\xfd\x01\x02"]
        theirs.send(b"\x5c\x03")
        assert received(ours) == [b"\x5c\x03"]
        assert ours.lost == ""
    finally:
        ours.close()
        ours.close()
        theirs.close()
    with pytest.raises(WireError, match="closed"):
        ours.send(b"\xfd")


def received(wire):
    until = time.monotonic() + LIMIT_S
    while time.monotonic() < until:
        if items := wire.receive():
            return items
        time.sleep(0.002)
    return []
