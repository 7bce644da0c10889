"""One suite over every kind of CAN wire that this machine can run; a dead bus, and buses that there are not."""

import uuid

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

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
    wire.send(CanFrame(0x111, b""))
    assert wire.receive() == []
    assert (wire.send_errors, wire.rejected) == (1, 1)
    wire.close()


def test_unusable_can_bus_error_says_the_remedy():
    with pytest.raises(WireError, match=r"python-can knows .*socketcan"):
        open_can("soketcan", "can0")
    with pytest.raises(WireError, match="ip link set can77 up"):
        open_can("socketcan", "can77")
