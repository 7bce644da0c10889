"""One suite over every kind of CAN wire that this machine can run; a dead bus, and buses that there are not."""

import uuid

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from groundcar.scout.codec import encode
from groundcar.scout.driver import Command, ScoutLink
from hil.contract.wire import CanFrame
from hil.wires import WireError
from hil.wires.can import PythonCanWire, open_can
from tests.contract.wire_makers import CAN_KINDS, can_virtual, collect, nothing_comes, opened


@pytest.fixture(params=CAN_KINDS)
def can_ends(request):
    yield from opened(CAN_KINDS[request.param])


frames = st.builds(CanFrame, st.integers(0, 0x7FF), st.binary(max_size=8))


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sent=st.lists(frames, min_size=1, max_size=20))
def test_can_frames_arrive_in_order_both_ways_and_are_not_echoed(can_ends, sent):
    for sender, receiver in (can_ends, can_ends[::-1]):
        for frame in sent:
            sender.send(frame)
        received = collect(receiver, lambda got: len(got) >= len(sent))
        assert received == sent
        assert all(isinstance(frame, CanFrame) for frame in received)
        assert sender.receive() == []


def test_equal_frames_of_both_ends_arrive_once_each(can_ends):
    a, b = can_ends
    same = CanFrame(0x111, bytes(8))
    a.send(same)
    b.send(same)
    assert collect(a, bool) == [same]
    assert collect(b, bool) == [same]
    assert nothing_comes(a)
    assert nothing_comes(b)


def test_non_standard_can_frames_are_counted_and_not_delivered():
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
def test_invalid_can_frames_raise(frame):
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


def test_dead_can_bus_is_counted_and_does_not_raise():
    wire = PythonCanWire(_DeadBus())
    assert wire.send(CanFrame(0x111, b"")) is False
    assert wire.lost == ""
    assert wire.receive() == []
    assert (wire.send_errors, wire.receive_errors) == (1, 1)
    assert wire.lost == "CAN bus: the adapter is gone or down (network is down)"
    wire.close()


def test_unusable_can_bus_error_names_the_remedy():
    with pytest.raises(WireError, match=r"python-can knows .*socketcan"):
        open_can("soketcan", "can0")
    with pytest.raises(WireError, match="ip link set can77 up"):
        open_can("socketcan", "can77")


class _ScriptedBus(can.BusABC):
    """Takes frames while `refusal` is None; gives the messages in `coming`."""

    def __init__(self):
        super().__init__("scripted")
        self.coming, self.refusal = [], None

    def send(self, msg, timeout=None):
        if self.refusal is not None:
            raise self.refusal

    def shutdown(self):
        self._is_shutdown = True

    def _recv_internal(self, timeout):
        return (self.coming.pop(0) if self.coming else None), False


def error_frame(identifier, data=bytes(8)):
    return can.Message(arbitration_id=identifier, is_error_frame=True, is_extended_id=False, data=data)


def test_refused_can_frame_is_not_sent_and_consecutive_refusals_are_a_fault():
    bus = _ScriptedBus()
    wire = PythonCanWire(bus)
    assert wire.send(CanFrame(0x111, b"")) is True
    bus.refusal = can.CanOperationError("Transmit buffer full")
    assert [wire.send(CanFrame(0x111, b"")) for _ in range(9)] == [False] * 9
    assert wire.lost == ""
    assert wire.send(CanFrame(0x111, b"")) is False
    assert wire.lost == "CAN bus: takes no frames (Transmit buffer full)"
    bus.refusal = None
    assert wire.send(CanFrame(0x111, b"")) is True
    assert wire.lost == ""


def test_unplugged_can_adapter_is_a_fault_at_once():
    bus = _ScriptedBus()
    wire = PythonCanWire(bus, name="CAN socketcan can0")
    bus.refusal = can.CanOperationError("Failed to transmit: No such device", 19)
    wire.send(CanFrame(0x111, b""))
    assert wire.lost.startswith("CAN socketcan can0: the adapter is gone or down")


def test_bus_off_is_a_fault_until_the_bus_restarts():
    bus = _ScriptedBus()
    wire = PythonCanWire(bus)
    bus.coming = [error_frame(0x40)]
    assert wire.receive() == []
    assert "bus off" in wire.lost
    bus.coming = [error_frame(0x100)]
    wire.receive()
    assert wire.lost == ""
    assert wire.errors.counts == {"bus off": 1, "restarted": 1}


def test_error_passive_is_a_fault_until_the_controller_is_active():
    bus = _ScriptedBus()
    wire = PythonCanWire(bus)
    bus.coming = [error_frame(0x04, bytes((0, 0x20, 0, 0, 0, 0, 0, 0)))]
    wire.receive()
    assert "error passive" in wire.lost
    bus.coming = [error_frame(0x04, bytes((0, 0x40, 0, 0, 0, 0, 0, 0)))]
    wire.receive()
    assert wire.lost == ""


def test_bus_with_only_error_frames_is_a_fault_and_single_error_frames_are_not():
    bus = _ScriptedBus()
    wire = PythonCanWire(bus)
    bus.coming = [error_frame(0x20) for _ in range(19)]
    wire.receive()
    assert wire.lost == ""
    bus.coming = [error_frame(0x20)]
    wire.receive()
    assert "no acknowledgement" in wire.lost
    bus.coming = [can.Message(arbitration_id=0x221, is_extended_id=False, data=b"x")]
    assert wire.receive() == [CanFrame(0x221, b"x")]
    assert wire.lost == ""


def test_car_driver_counts_only_frames_that_the_bus_accepted():
    """100 of 100 refused frames are no sent commands; the wire reports the trouble."""
    bus = _ScriptedBus()
    wire = PythonCanWire(bus)
    link = ScoutLink(wire)
    feedback = [encode("SystemState", {"mode": 1, "battery": 26.0}), encode("MotionState", {})]
    for step in range(200):
        bus.coming = [can.Message(arbitration_id=i, is_extended_id=False, data=d) for i, d in feedback]
        bus.refusal = None if step < 100 else can.CanOperationError("Transmit buffer full")
        now = step * 20_000_000
        sent = link.step(now, Command(now, 0.3, 0.0)).sent_commands
        assert sent == min(step + 1, 100)
    assert "takes no frames" in wire.lost
