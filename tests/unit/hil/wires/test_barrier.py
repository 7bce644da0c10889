"""A set-point has been processed before `send` returns."""

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


def setpoint():
    return Packer(245, 190).send_name(
        "SET_ATTITUDE_TARGET", 0, 1, 1, 128, (1.0, 0.0, 0.0, 0.0), 0.1, 0.0, 0.0, 0.5, (0.0,) * 3
    )


def answering(wire, other):
    """The firmware has answered its first PING."""
    wire.send(setpoint())
    wire.receive()
    other.got.clear()


def test_nothing_is_waited_for_before_the_firmware_has_answered(ends):
    wire, other = ends
    other.deaf = True
    for _ in range(3):
        wire.send(setpoint())
    assert (other.got, wire.missed) == (3 * ["SET_ATTITUDE_TARGET", "PING"], 0)


def test_set_point_is_followed_by_a_ping_and_its_answer(ends):
    wire, other = ends
    answering(wire, other)
    wire.send(setpoint())
    assert other.got == ["SET_ATTITUDE_TARGET", "PING"]
    names = [f.name for data in wire._waiting for f in Parser().feed(data)]
    assert names == ["HEARTBEAT", "PING"], "what came while it waited is kept"
    assert wire.missed == 0


def test_command_is_not_waited_for(ends):
    """It has an acknowledgement; PX4 receives nothing while it waits, by its clock, for a stream to begin."""
    wire, other = ends
    answering(wire, other)
    wire.send(Packer(245, 190).send_name("COMMAND_LONG", 1, 1, 511, 0, *(0.0,) * 7))
    assert other.got == ["COMMAND_LONG"]


def test_firmware_that_stops_answering_is_waited_for_once(ends, monkeypatch):
    wire, other = ends
    answering(wire, other)
    monkeypatch.setattr(barrier, "_PING_S", 0.02)
    other.deaf = True
    for _ in range(5):
        wire.send(setpoint())
        other.waiting.append(other.odometry(1000))
        wire.receive()
    assert wire.missed == 1
    wire.close()
    assert other.got[-1] == "closed"


def test_firmware_that_answers_again_is_waited_for_again(ends, monkeypatch):
    wire, other = ends
    answering(wire, other)
    monkeypatch.setattr(barrier, "_PING_S", 0.02)
    other.deaf = True
    wire.send(setpoint())
    other.deaf = False
    wire.send(setpoint())
    assert other.waiting, "its answer was not waited for"
    wire.receive()
    wire.send(setpoint())
    assert (other.waiting, wire.missed) == ([], 1)


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
    monkeypatch.setattr(barrier, "_ODOMETRY_S", 0.01)
    for time_us in (0, 8000, 16000):
        other.now_us = time_us
        other.waiting.append(other.odometry(time_us))
        wire.receive()
    for other.now_us in (40000, 50000, 60000):
        assert wire.receive() == []
    assert wire.missed == 1
