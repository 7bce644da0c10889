import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from hil.contract.messages import BoardState
from hil.recording.reader import ReadError, Recording
from tests.unit.hil.recording.recorded_flight import flight, record


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record(tmp_path_factory.mktemp("run") / "run.mcap", pictures="preview")


def test_reader_returns_typed_messages_in_order(recorded):
    recording = Recording(recorded)
    assert recording.complete
    assert recording.faults == []
    entries = list(recording.messages())
    expected = [(t, topic, message) for t, topic, message in flight() if topic != "camera/image"]
    assert [e.log_ns for e in entries] == sorted(e.log_ns for e in entries)
    assert sorted(entries, key=lambda e: (e.log_ns, e.topic)) == sorted(expected, key=lambda e: e[:2])


def test_reader_filters_by_topic_and_opens_a_run_folder(recorded):
    boards = list(Recording(recorded.parent).messages(["truth/board"]))
    assert len(boards) == 300
    assert all(isinstance(e.message, BoardState) for e in boards)


def test_counts_and_topics(recorded):
    recording = Recording(recorded)
    counts = recording.counts()
    assert counts["/perch/truth/board"] == 300
    assert counts["/perch/car/command"] == 0
    assert recording.topics["/camera/image"] == "foxglove.CompressedImage"


def test_a_topic_the_contract_does_not_list_is_refused(recorded):
    with pytest.raises(ReadError, match="no topic 'truth/bored'"):
        list(Recording(recorded).messages(["truth/bored"]))


@given(st.data())
@settings(max_examples=60)
def test_recording_cut_anywhere_returns_all_flushed_messages(recorded, tmp_path_factory, data):
    whole = recorded.read_bytes()
    full = [(r.topic, r.log_ns, r.data) for r in Recording(recorded).raw()]
    size = data.draw(st.integers(0, len(whole) - 1))
    path = tmp_path_factory.mktemp("cut") / "run.mcap"
    path.write_bytes(whole[:size])
    try:
        recording = Recording(path)
    except ReadError as error:
        assert str(path) in str(error)
        assert size < 12_000  # only while the topics are not all there yet
        return
    found = [(r.topic, r.log_ns, r.data) for r in recording.raw()]
    assert set(found) <= set(full)
    assert recording.complete or recording.faults
    if recording.complete:
        assert found == full


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_flipped_bytes_never_give_a_wrong_message(recorded, tmp_path_factory, seed):
    rng = random.Random(seed)
    damaged = bytearray(recorded.read_bytes())
    start = 20_000  # behind the topics' descriptions
    for _ in range(rng.randint(1, 20)):
        damaged[rng.randrange(start, len(damaged))] ^= rng.randint(1, 255)
    path = tmp_path_factory.mktemp("flip") / "run.mcap"
    path.write_bytes(damaged)
    full = {(r.topic, r.log_ns, r.data) for r in Recording(recorded).raw()}
    recording = Recording(path)
    assert {(r.topic, r.log_ns, r.data) for r in recording.raw()} <= full


def test_damaged_block_loses_only_its_own_messages(recorded, tmp_path):
    with recorded.open("rb") as file:
        chunk = make_reader(file).get_summary().chunk_indexes[0]
    damaged = bytearray(recorded.read_bytes())
    damaged[chunk.chunk_start_offset + 200] ^= 0xFF
    path = tmp_path / "run.mcap"
    path.write_bytes(damaged)
    recording = Recording(path)
    boards = list(recording.messages(["truth/board"]))
    assert len(boards) == 200
    assert boards[0].log_ns == 1_000_000_000
    assert "is damaged and was left out" in recording.faults[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"not a recording at all", "is no MCAP recording"),
        (bytes(range(256)) * 10, "is no MCAP recording"),
        (b"\x89MCAP0\r\n", "not a recording of perch-hil"),
        (b"\x89MCAP0\r\n" + b"\xff" * 500, "not a recording of perch-hil"),
    ],
)
def test_file_that_is_not_mcap_raises_a_clear_error(tmp_path, content, message):
    path = tmp_path / "run.mcap"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=message):
        Recording(path)


def test_missing_recording_raises_a_clear_error(tmp_path):
    with pytest.raises(ReadError, match="cannot be read"):
        Recording(tmp_path / "run.mcap")


def foreign(path, topics, compression=CompressionType.NONE):
    writer = Writer(str(path), compression=compression)
    writer.start()
    schema = writer.register_schema("x", "jsonschema", b"{}")
    for topic in topics:
        channel = writer.register_channel(topic, "json", schema)
        for i in range(10):
            writer.add_message(channel, i, b"{}", i)
    writer.finish()
    return path


def test_mcap_of_another_program_raises_a_clear_error(tmp_path):
    with pytest.raises(ReadError, match=r"an MCAP file, but not a recording of perch-hil \(topics: /chatter\)"):
        Recording(foreign(tmp_path / "other.mcap", ["/chatter"]))


def test_foreign_message_on_a_contract_topic_is_skipped_and_reported(tmp_path):
    recording = Recording(foreign(tmp_path / "odd.mcap", ["/other", "/perch/truth/board"]))
    assert list(recording.messages(["truth/board"])) == []
    assert "perch.BoardState" in recording.faults[0]


def test_messages_rewritten_by_another_tool_can_be_read(recorded, tmp_path):
    path = tmp_path / "rewritten.mcap"
    writer = Writer(str(path), compression=CompressionType.NONE, chunk_size=1 << 16)
    writer.start()
    channels = {}
    with recorded.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
    writer.finish()
    again = [e for e in Recording(path).messages(["belief", "truth/board"])]
    before = [e for e in Recording(recorded).messages(["belief", "truth/board"])]
    assert sorted(again, key=lambda e: e[:2]) == sorted(before, key=lambda e: e[:2])
