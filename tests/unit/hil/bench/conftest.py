"""Fixtures of the ground station's link."""

import pytest

from hil.bench import ground
from hil.host.pytest_px4 import px4_sim  # noqa: F401  (the fixture starts the autopilot)
from tests.unit.hil.bench.px4_link import LIMIT_S, LOGS


@pytest.fixture
def px4(px4_sim, monkeypatch):  # noqa: F811
    monkeypatch.setattr(ground, "_FIND_S", LIMIT_S)
    monkeypatch.setattr(ground, "_BEAT_S", 0.0)  # there is one autopilot only
    monkeypatch.setattr(ground, "_EVENTS_S", 0.0)  # the software PX4 has no texts of its events
    started = px4_sim()
    started.offboard._partner_rule = "last"  # each command is a client of its own, and PX4 would keep the first
    return started


@pytest.fixture
def with_logs(px4):
    """Answers LOG_REQUEST_LIST and LOG_REQUEST_DATA as PX4 does; every seventh block is lost at first."""
    lost = set()

    def entries(port, frame, m):
        for number, data in LOGS.items():
            port.send_name("LOG_ENTRY", number, len(LOGS), max(LOGS), 1_700_000_000 + number, len(data))

    def blocks(port, frame, m):
        data = LOGS[m.id][m.ofs : m.ofs + m.count]
        for at in range(0, len(data), 90):
            block = data[at : at + 90]
            if (m.ofs + at) // 90 % 7 == 3 and m.ofs + at not in lost:
                lost.add(m.ofs + at)
                continue
            port.send_name("LOG_DATA", m.id, m.ofs + at, len(block), tuple(block.ljust(90, b"\0")))

    with px4.held() as autopilot:
        autopilot.receiver._handlers |= {"LOG_REQUEST_LIST": entries, "LOG_REQUEST_DATA": blocks}
    return px4
