"""Columns that are read without decoding hold what decoding gives; a long recording keeps its peaks."""

import dataclasses
import struct
from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.contract.codec import CodecError, codec
from hil.contract.messages import Belief, Detection, Event, Sent, VehicleState
from hil.recording import reader
from hil.recording.reader import Recording
from hil.recording.recorder import Recorder
from hil.report.drawing.charts import thin
from hil.report.recorded.columns import Columns, Messages
from hil.report.recorded.flight import load
from hil.report.recorded.read import read_columns, scored_messages
from hil.scoring.score import SCORED, score_messages
from tests.paths import GOLDEN_RUN

FLOATS = st.floats(width=64)
SENT = st.builds(
    Sent, st.integers(-(2**63), 2**63 - 1), st.tuples(FLOATS, FLOATS, FLOATS), FLOATS, FLOATS, st.booleans(),
    st.text(max_size=5),
)  # fmt: skip


def packed(kind, datas):
    offsets = np.concatenate([[0], np.cumsum([len(data) for data in datas])]).astype(np.int64)
    return Messages(kind, b"".join(datas), offsets)


def columns(kind, messages):
    return Columns(np.arange(len(messages)), packed(kind, [codec(kind).encode(one) for one in messages]))


@given(st.lists(SENT, min_size=1, max_size=40))
def test_columns_equal_the_fields_of_the_messages(messages):
    read = columns(Sent, messages)
    checked, bad = read.messages.checked()
    assert repr(list(checked)) == repr(messages) and bad == {}
    np.testing.assert_array_equal(read.nanoseconds(), [m.stamp_ns for m in messages])
    np.testing.assert_array_equal(read["body_rate"], [m.body_rate for m in messages])
    np.testing.assert_array_equal(read["thrust"], [m.thrust for m in messages])
    np.testing.assert_array_equal(read["limited"], [float(m.limited) for m in messages])
    assert [text.rstrip("\0") for text in read["tripped"]] == [m.tripped.rstrip("\0") for m in messages]


def test_columns_of_a_recorded_flight_equal_its_messages():
    for topic, read in load(GOLDEN_RUN).topics.items():
        for name in (f.name for f in dataclasses.fields(read.messages.kind)):
            values = [getattr(message, name) for message in read.messages]
            assert len(read) == len(values), topic
            if isinstance(values[0], int | float | str):
                np.testing.assert_array_equal(read[name], np.array(values), err_msg=f"{topic} {name}")


def test_variance_of_changing_length_is_not_an_array():
    one = Belief(0, True, (0.0,) * 3, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, (1.0, 2.0), 0.0, 0, 0.0)
    read = columns(Belief, [one, dataclasses.replace(one, variance=(1.0,))])["variance"]
    assert read.dtype == object and read.tolist() == [(1.0, 2.0), (1.0,)]


def test_fault_names_only_the_damaged_message():
    good = codec(Event).encode(Event(5, "info", "a", "b"))
    bad = good[:-1] + b"\xff"  # no UTF-8
    whole, found = packed(Event, [good, bad, good, b"\xff"]).checked()
    assert list(found) == [1, 3] and [m.text for m in whole] == ["b", "b"]


def test_columns_of_any_number_of_values_are_read_without_decoding():
    one = Detection(5, True, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 0.1, 0.1, (3, 200, 0), (1.0, 2.0, 3.0, 4.0), "", 1, 2)
    none = dataclasses.replace(one, tag_ids=(), corners_px=())
    read = columns(Detection, [one, none, dataclasses.replace(one, corners_px=(5.0, 6.0))])
    assert read.lengths("tag_ids").tolist() == [3, 0, 3]
    assert read.lengths("corners_px").tolist() == [4, 0, 2]
    assert read.flat("corners_px").tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert read["tag_ids"].tolist() == [(3, 200, 0), (), (3, 200, 0)]


def test_rows_hold_the_values_that_decoding_gives():
    sent = [Sent(7, (0.1, 0.2, 0.3), 9.8, 0.5, True, ""), Sent(-8, (0.0,) * 3, 0.0, 0.0, False, "rate")]
    rows = list(columns(Sent, sent).rows("stamp_ns", "limited", "thrust", "tripped"))
    assert [(r.stamp_ns, r.limited, r.thrust, r.tripped) for r in rows] == [(7, 1, 9.8, ""), (-8, 0, 0.0, "rate")]
    assert all(type(r.stamp_ns) is int and type(r.thrust) is float for r in rows)


def test_a_message_written_in_another_way_is_written_anew():
    unpacked = bytes([1 << 3 | 0, 7]) + b"".join(bytes([2 << 3 | 1]) + struct.pack("<d", v) for v in (1.0, 2.0, 3.0))
    checked, bad = packed(Sent, [unpacked, b""]).checked()
    assert bad == {} and Columns(np.arange(2), checked)["body_rate"].tolist() == [[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]


@given(SENT, st.lists(st.tuples(st.integers(0, 200), st.integers(0, 255)), max_size=4), st.integers(0, 200))
def test_damaged_bytes_give_a_fault_or_the_columns_of_what_they_decode_to(sent, flips, length):
    data = bytearray(codec(Sent).encode(sent))
    for at, value in flips:
        data[at % len(data)] = value
    whole, bad = packed(Sent, [bytes(data[:length])]).checked()
    try:
        decoded = codec(Sent).decode(bytes(data[:length]))
    except CodecError:
        assert list(bad) == [0] and len(whole) == 0
        return
    read = Columns(np.arange(1), whole)
    assert bad == {} and read.nanoseconds()[0] == decoded.stamp_ns
    np.testing.assert_array_equal(read["body_rate"][0], decoded.body_rate)
    assert (read["limited"][0] > 0) == decoded.limited
    assert read["tripped"][0].rstrip("\0") == decoded.tripped.rstrip("\0")


def test_poses_of_a_long_recording_are_kept_at_25_hz_but_for_its_last_90_s(tmp_path):
    with Recorder(tmp_path / "run.mcap") as recorder:
        for t in range(0, 150_000_000_000, 4_000_000):
            recorder(t, "truth/vehicle", VehicleState(t, (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3))
    read = read_columns(Recording(tmp_path / "run.mcap"), ["truth/vehicle"])["truth/vehicle"]
    early = read.log_ns < read.log_ns[-1] - 90_000_000_000
    assert np.diff(read.log_ns[early]).tolist() == [40_000_000] * (int(early.sum()) - 1) and early.sum() == 1500
    assert (np.diff(read.log_ns[~early]) == 4_000_000).all()
    assert len(read.published_ns) == 250 * 150


def test_a_drawn_series_keeps_its_peaks():
    t = np.arange(0, 1800_000_000_000, 10_000_000)
    y = np.sin(t / 1e9)
    y[[777, 90_001]] = 50.0, -50.0
    y[1234] = np.nan
    recorded = SimpleNamespace(window_ns=(0, int(t[-1])), span_ns=(0, int(t[-1])), topics={})
    keep = thin(recorded, t, y)  # type: ignore[arg-type]
    assert {777, 90_001} <= set(keep.tolist()) and len(keep) < 20_000
    assert (np.diff(keep) > 0).all()


def test_a_recording_scores_as_its_messages_do_one_by_one(monkeypatch):
    monkeypatch.setattr(reader, "_BLOCK_BYTES", 1)  # a chunk a block: most hold no event and no verdict
    recorded = load(GOLDEN_RUN)
    assert recorded.scenario is not None and recorded.rescored is not None
    recording = Recording(GOLDEN_RUN)
    slow = score_messages(recorded.scenario, recorded.manifest["seed"], recording.messages(SCORED))
    assert recorded.rescored == slow
    assert sum(1 for _ in scored_messages(recording)) < sum(1 for _ in recording.messages(SCORED))
