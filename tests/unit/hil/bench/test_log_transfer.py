"""A log that is fetched in several goes: it comes whole, and what has come is not asked for again."""

import pytest

from hil.bench import log_transfer
from hil.bench.ground import GroundStation
from hil.bench.reading import Unavailable
from tests.unit.hil.bench.px4_link import LOGS, link

BLOCK, CHUNK = 90, 900
SIZE = len(LOGS[2])


@pytest.fixture
def asked(with_logs, monkeypatch):
    """Every (offset, count) that the autopilot was asked for."""
    monkeypatch.setattr(log_transfer, "_CHUNK", CHUNK)
    found = []
    with with_logs.held() as autopilot:
        answers = autopilot.receiver._handlers["LOG_REQUEST_DATA"]

        def noted(port, frame, m):
            found.append((m.ofs, m.count))
            answers(port, frame, m)

        autopilot.receiver._handlers["LOG_REQUEST_DATA"] = noted
    return found


def test_log_of_several_chunks_with_lost_blocks_comes_whole(asked, with_logs, tmp_path):
    shares = []
    with GroundStation(link(with_logs)) as station:
        station.download(station.logs()[-1], tmp_path / "whole.ulg", shares.append)
    assert (tmp_path / "whole.ulg").read_bytes() == LOGS[2]
    assert shares == sorted(shares) and shares[-1] == 1.0
    again = [(at, count) for at, count in asked if at % CHUNK]
    assert (270, BLOCK) in again and (900, 8 * BLOCK) in asked  # one block lost of the first chunk, of the second two


def test_interrupted_transfer_goes_on_where_it_stopped(asked, with_logs, tmp_path):
    path = tmp_path / "log.ulg"

    def stop(share):
        if share > 0.5:
            raise KeyboardInterrupt

    with GroundStation(link(with_logs)) as station:
        with pytest.raises(KeyboardInterrupt):
            station.download(station.logs()[-1], path, stop)
        (part,) = tmp_path.iterdir()
        come = part.stat().st_size
        assert 0.3 * SIZE < come < 0.6 * SIZE and come % CHUNK == 0 and part.name.startswith(".")
        with part.open("ab") as file:
            file.write(b"torn")  # a block of which a full disk took only the beginning
        asked.clear()
        station.download(station.logs()[-1], path)
    assert path.read_bytes() == LOGS[2] and min(at for at, _ in asked) == come
    assert list(tmp_path.iterdir()) == [path]


def test_part_of_another_log_is_not_continued(asked, with_logs, tmp_path):
    path = tmp_path / "log.ulg"
    (tmp_path / ".log.ulg.2-99-20200101.part").write_bytes(b"another log" * 90)
    (tmp_path / ".other.ulg.2-99-20200101.part").write_bytes(b"of another file")
    with GroundStation(link(with_logs)) as station:
        station.download(station.logs()[-1], path)
    assert path.read_bytes() == LOGS[2] and asked[0] == (0, CHUNK)
    assert sorted(one.name for one in tmp_path.iterdir()) == [".other.ulg.2-99-20200101.part", "log.ulg"]


def test_log_that_is_shorter_than_its_entry_says_where_it_stopped(asked, with_logs, tmp_path):
    with GroundStation(link(with_logs)) as station:
        (_, log) = station.logs()
        with log_transfer.LogTransfer(station._found) as transfer, pytest.raises(Unavailable, match="stopped at byte"):
            transfer.fetch(log.id, SIZE + 5000, tmp_path / "part", 0.8, lambda _: None)
    assert (tmp_path / "part").read_bytes() == LOGS[2][: SIZE // CHUNK * CHUNK]
