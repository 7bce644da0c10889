"""A serial port: raw, never blocking, with clear errors."""

import termios
import time

import pytest

from hil.wires import WireError
from hil.wires.serial import BACKLOG, SerialWire, shorten_latency
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


@pytest.fixture
def usb(tmp_path):
    """A folder like the kernel's, with one FTDI port and one port without a latency timer."""
    (tmp_path / "ttyUSB0").mkdir()
    (tmp_path / "ttyUSB1").mkdir()
    (tmp_path / "ttyUSB0" / "latency_timer").write_text("16\n")
    return tmp_path


def test_latency_timer_of_an_ftdi_port_is_shortened(usb):
    assert shorten_latency("/dev/ttyUSB0", usb) == ""
    assert (usb / "ttyUSB0" / "latency_timer").read_text() == "1\n"
    assert shorten_latency("/dev/ttyUSB0", usb) == ""


def test_serial_port_without_a_latency_timer_is_left_alone(usb):
    assert shorten_latency("/dev/ttyUSB1", usb) == shorten_latency("/dev/ttyACM0", usb) == ""


def test_latency_timer_is_found_through_a_stable_name(usb, tmp_path):
    link = tmp_path / "by-id"
    link.symlink_to("/dev/ttyUSB0")
    assert shorten_latency(str(link), usb) == ""
    assert (usb / "ttyUSB0" / "latency_timer").read_text() == "1\n"


def test_latency_timer_that_cannot_be_set_is_told_with_the_remedy(usb, monkeypatch):
    def forbidden(*_, **__):
        raise PermissionError(13, "Permission denied")

    timer = usb / "ttyUSB0" / "latency_timer"
    monkeypatch.setattr(type(timer), "write_text", forbidden)
    text = shorten_latency("/dev/ttyUSB0", usb)
    assert text == f"/dev/ttyUSB0 keeps what it receives for 16 ms (FTDI latency timer): echo 1 | sudo tee {timer}"


def test_port_states_its_latency_when_it_is_opened(monkeypatch):
    monkeypatch.setattr("hil.wires.serial.shorten_latency", lambda _: "keeps what it receives")
    for near, _ in opened(serial_pair):
        assert near.remark == "keeps what it receives"
