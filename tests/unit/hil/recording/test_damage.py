"""A recording with single damaged places: the rest is read, and what is missing is reported in seconds and topics."""

import shutil
import struct
from datetime import UTC, datetime

import pytest
from mcap.reader import make_reader

from hil.recording.reader import Recording
from hil.recording.recover import recover
from tests.unit.hil.recording.recorded_flight import record

BOARD = "/perch/truth/board"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return record(tmp_path_factory.mktemp("run") / "run.mcap", pictures="preview", seconds=6.0)


@pytest.fixture(scope="module")
def summary(whole):
    with whole.open("rb") as file:
        return make_reader(file).get_summary()


def small_chunks(summary):
    return [c for c in summary.chunk_indexes if c.compression]


def damaged(whole, tmp_path, change):
    data = bytearray(whole.read_bytes())
    change(data)
    (tmp_path / "run.mcap").write_bytes(data)
    return tmp_path / "run.mcap"


def set_length(data, at, length):
    data[at + 1 : at + 9] = struct.pack("<Q", length)


def without_index(data):
    data[-20] ^= 0xFF  # in the footer: its checksum does not match any more


def messages(path):
    return [(raw.topic, raw.log_ns, raw.data) for raw in Recording(path).raw()]


@pytest.mark.parametrize("length", [0, 7, 1 << 20, 1 << 40, 2**64 - 1])
def test_damaged_length_loses_no_message_with_an_intact_index(whole, summary, tmp_path, length):
    start = small_chunks(summary)[1].chunk_start_offset
    path = damaged(whole, tmp_path, lambda data: set_length(data, start, length))
    assert messages(path) == messages(whole)
    assert Recording(path).missing() == []


@pytest.mark.parametrize("length", [0, 7, 1 << 20, 1 << 40, 2**64 - 1])
def test_damaged_length_loses_one_block_without_an_index(whole, summary, tmp_path, length):
    chunk = small_chunks(summary)[1]

    def change(data):
        set_length(data, chunk.chunk_start_offset, length)
        without_index(data)

    recording = Recording(damaged(whole, tmp_path, change))
    assert len(list(recording.raw([BOARD]))) == 500
    assert any("damaged at byte" in fault for fault in recording.faults)
    gap = next(gap for gap in recording.missing() if gap.topic == BOARD)
    assert (gap.messages, gap.start_ns, gap.end_ns) == (100, 990_000_000, 2_000_000_000)
    assert str(gap) == "truth/board: 100 messages are missing between 0.99 and 2.00 s"


def test_damaged_message_index_loses_no_message(whole, summary, tmp_path):
    chunk = small_chunks(summary)[1]

    def change(data):
        set_length(data, chunk.chunk_start_offset + chunk.chunk_length, 5000)
        without_index(data)

    path = damaged(whole, tmp_path, change)
    assert messages(path) == messages(whole)


def test_damaged_last_blocks_are_counted_by_the_index(whole, summary, tmp_path):
    def change(data):
        for chunk in small_chunks(summary)[-2:]:
            data[chunk.chunk_start_offset + chunk.chunk_length - 4] ^= 0xFF

    recording = Recording(damaged(whole, tmp_path, change))
    lost = {gap.topic: gap for gap in recording.missing()}
    assert len(list(recording.raw([BOARD]))) == 500
    assert lost[BOARD] == (BOARD, 100, 4_990_000_000, 6_000_000_000)
    assert lost["/perch/event"].messages == 1


def test_flipped_bit_in_a_topic_name_is_reported_and_loses_no_topic(whole, tmp_path):
    def change(data):
        data[data.index(BOARD.encode()) + 3] ^= 0x01

    path = damaged(whole, tmp_path, change)
    recording = Recording(path)
    assert len(list(recording.messages(["truth/board"]))) == 600
    assert messages(path) == messages(whole)
    assert recording.faults == ["the topics' descriptions at its front contradict its index: the index was used"]


def test_topic_without_a_description_is_reported(whole, tmp_path):
    def change(data):
        at = data.index(BOARD.encode()) - 8  # its channel's number
        data[at] ^= 0x40
        start = at
        while (start := data.find(BOARD.encode(), start + 9)) != -1:
            data[start - 8] ^= 0x40
        without_index(data)

    recording = Recording(damaged(whole, tmp_path, change))
    assert list(recording.raw([BOARD])) == []
    list(recording.raw())
    assert any("a topic that is not described" in fault for fault in recording.faults)


def test_recover_reports_missing_messages(whole, summary, tmp_path):
    chunk = small_chunks(summary)[1]

    def change(data):
        data[chunk.chunk_start_offset + 200] ^= 0xFF

    shutil.copy(damaged(whole, tmp_path, change), tmp_path / "keep.mcap")
    (tmp_path / "manifest.json").write_text('{"state": "finished"}')
    done = recover(tmp_path, datetime(2026, 1, 2, tzinfo=UTC))
    assert "truth/board: 100 messages are missing between 0.99 and 2.00 s" in done.faults
    assert done.original is not None and Recording(tmp_path).missing() == []
