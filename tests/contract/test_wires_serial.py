"""A serial port: raw, never blocking, with clear errors."""

import termios
import time

import pytest

from hil.wires import WireError
from hil.wires.serial import BACKLOG, SerialWire
from tests.contract.wire_makers import collect, collect_bytes, opened, serial_pair


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


def test_blocked_serial_port_drops_whole_items():
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


def test_unplugged_serial_port_is_reported_not_raised():
    near, far = serial_pair()
    far.close()
    near.send(b"x")
    near.receive()
    assert "gone" in near.lost
    near.send(b"y")
    assert near.dropped == 1
    near.close()


def test_serial_errors_name_the_remedy(tmp_path):
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
