"""What was sent has been processed before `send` returns."""

import pytest

from hil.wires import barrier
from hil.wires.barrier import BarrierWire
from vehicle.px4.codec import Packer, Parser


class Other:
    """A firmware at the other end of the wire: answers PINGs at once, unless `deaf`."""

    def __init__(self):
        self.packer, self.parser, self.waiting, self.got, self.deaf = Packer(1, 1), Parser(), [], [], False
        self.now_us, self.late = 0, []

    def send(self, data):
        for frame in self.parser.feed(data):
            self.got.append(frame.name)
            if frame.name == "PING" and not self.deaf:
                self.waiting.append(self.packer.send_name("HEARTBEAT", 2, 12, 1, 0, 3, 3))
                self.waiting.append(self.packer.send_name("PING", 0, frame.fields.seq, frame.system, frame.component))

    def receive(self):
        items, self.waiting, self.late = self.waiting, self.late, []
        return items

    def odometry(self, time_us):
        zeros = (0.0,) * 3
        covariance = (0.0,) * 21
        rest = (covariance, covariance, 0, 8, 0)
        return self.packer.send_name("ODOMETRY", time_us, 1, 1, *zeros, (1.0, 0.0, 0.0, 0.0), *zeros, *zeros, *rest)

    def close(self):
        self.got.append("closed")


@pytest.fixture
def ends():
    other = Other()
    return BarrierWire(other, lambda: other.now_us), other


def frame():
    return Packer(245, 190).send_name("HEARTBEAT", 18, 8, 0, 0, 4, 3)


def test_nothing_is_waited_for_before_the_firmware_is_heard(ends):
    wire, other = ends
    wire.send(frame())
    assert other.got == ["HEARTBEAT"]


def test_each_item_is_followed_by_a_ping_and_its_answer(ends):
    wire, other = ends
    other.waiting.append(b"\xfd")
    wire.receive()
    wire.send(frame())
    assert other.got == ["HEARTBEAT", "PING"]
    names = [f.name for data in wire.receive() for f in Parser().feed(data)]
    assert names == ["HEARTBEAT", "PING"], "what came while it waited is kept"
    assert wire.missed == 0


def test_firmware_that_does_not_answer_is_counted(ends, monkeypatch):
    wire, other = ends
    other.waiting.append(b"\xfd")
    wire.receive()
    other.deaf = True
    monkeypatch.setattr(barrier, "_PATIENCE_S", 0.02)
    wire.send(frame())
    assert wire.missed == 1
    wire.close()
    assert other.got[-1] == "closed"


def test_firmware_that_was_silent_is_asked_again_once_it_is_heard(ends, monkeypatch):
    wire, other = ends
    monkeypatch.setattr(barrier, "_PATIENCE_S", 0.02)
    other.waiting.append(b"\xfd")
    wire.receive()
    other.deaf = True
    for _ in range(5):
        wire.send(frame())
    assert wire.missed == 1, "waited for once"
    other.deaf = False
    other.waiting.append(b"\xfd")
    wire.receive()
    wire.send(frame())
    assert (other.got[-1], wire.missed) == ("PING", 1)


def test_odometry_that_is_due_is_waited_for(ends):
    wire, other = ends
    for time_us in (0, 8000, 16000):
        other.now_us = time_us + 4000
        other.waiting.append(other.odometry(time_us))
        assert wire.receive()
    late = other.odometry(24000)
    other.now_us, other.late = 34000, [late]
    assert wire.receive() == [late] and wire.missed == 0


def test_odometry_that_has_stopped_is_waited_for_once(ends, monkeypatch):
    wire, other = ends
    monkeypatch.setattr(barrier, "_PATIENCE_S", 0.02)
    for time_us in (0, 8000, 16000):
        other.now_us = time_us
        other.waiting.append(other.odometry(time_us))
        wire.receive()
    for other.now_us in (40000, 50000, 60000):
        assert wire.receive() == []
    assert wire.missed == 1
