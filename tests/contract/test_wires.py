"""One suite over every kind of byte wire that this machine can run."""

import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.wires import WireError
from tests.contract.wire_makers import BYTE_KINDS, collect, collect_bytes, nothing_comes, opened


@pytest.fixture(params=BYTE_KINDS)
def byte_ends(request):
    yield from opened(BYTE_KINDS[request.param])


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(items=st.lists(st.binary(min_size=1, max_size=280), min_size=1, max_size=20))
def test_bytes_arrive_whole_and_in_order_both_ways(byte_ends, items):
    for sender, receiver in (byte_ends, byte_ends[::-1]):
        for item in items:
            sender.send(item)
        assert b"".join(collect_bytes(receiver, sum(map(len, items)))) == b"".join(items)


@pytest.mark.parametrize("kind", ["memory", "udp"])
def test_datagrams_arrive_one_by_one(kind):
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
def test_closed_byte_wire_receives_nothing(kind):
    for a, b in opened(BYTE_KINDS[kind]):
        b.send(b"late")
        a.close()
        assert a.receive() == []
        if kind != "memory":
            with pytest.raises(WireError, match="closed"):
                a.send(b"x")
