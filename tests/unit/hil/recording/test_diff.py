import shutil
from datetime import UTC, datetime

import pytest

from hil.contract.messages import CarCommand
from hil.recording.diff import diff_runs
from hil.recording.provenance import Code
from hil.recording.recorder import Recorder
from hil.recording.runs import RunError, new_run, write_json
from tests.unit.hil.recording.recorded_flight import flight, record

CODE = Code("git", "0.1.0", "a" * 40)


@pytest.fixture
def make(tmp_path):
    count = iter(range(100))

    def make(recorder=record, seed=7, score=None, **how):
        run = new_run(
            tmp_path,
            scenario={"name": "hard-i"},
            rig={"name": "sim"},
            seed=seed,
            host="lockstep",
            policy={"name": "planner"},
            simulated=True,
            started_utc=datetime(2026, 1, 2, 3, 4, next(count), tzinfo=UTC),
            code=CODE,
        )
        recorder(run.recording, **how)
        write_json(run.path / "score.json", score or {"attached": True, "metrics": {"x": 0.1}})
        run.finish("finished", datetime(2026, 1, 2, 3, 5, next(count), tzinfo=UTC), real_time_factor=1.0 + seed)
        return run.path

    return make


def test_equal_runs_differ_only_in_the_wall_clock(make):
    difference = diff_runs(make(pictures="preview"), make(pictures="preview"))
    assert difference.identical
    assert difference.lines() == [
        f"identical: {difference.messages} messages, score and manifest (but for the wall clock)"
    ]
    assert difference.messages > 1800


def test_the_first_difference_of_a_topic_names_field_and_size(make):
    difference = diff_runs(make(), make(offset=1e-9))
    assert not difference.same_messages
    by_topic = {d.topic: d for d in difference.topics}
    assert set(by_topic) == {"/perch/belief", "/tf", "/belief/pose"}
    belief = by_topic["/perch/belief"]
    assert (belief.index, belief.time_ns) == (100, 1_000_000_000)
    assert belief.text.startswith("position is (3.0, 0.0, 1.5) and (3.00")
    assert belief.text.endswith("(largest difference 1e-09)")
    assert "bytes, which differ from byte" in by_topic["/belief/pose"].text
    assert "messages agree" in difference.lines()[0]


def test_diff_finds_a_difference_of_one_bit(make):
    def negative_zero(path):
        with Recorder(path, topics=["car/command"]) as recorder:
            recorder(0, "car/command", CarCommand(0, -0.0, 1.5))

    def zero(path):
        with Recorder(path, topics=["car/command"]) as recorder:
            recorder(0, "car/command", CarCommand(0, 0.0, 1.5))

    [found] = diff_runs(make(zero), make(negative_zero)).topics
    assert found.text == "speed is 0.0 and -0.0 (largest difference 0)"


def test_diff_compares_publication_times(make):
    def late(path):
        with Recorder(path) as recorder:
            for now_ns, topic, message in flight(1.0):
                recorder(now_ns + (1000 if topic == "event" else 0), topic, message)

    def punctual(path):
        with Recorder(path) as recorder:
            for entry in flight(1.0):
                recorder(*entry)

    [found] = diff_runs(make(punctual), make(late)).topics
    assert (found.topic, found.text) == ("/perch/event", "published at 1000000000 and 1000001000 ns (+0.001 ms)")


def test_diff_reports_missing_messages_and_topics(make):
    texts = {d.topic: d.text for d in diff_runs(make(seconds=2.0), make(seconds=1.0)).topics}
    assert texts["/perch/truth/board"] == "the first run has 100 messages more"
    assert "/perch/event" in texts  # ends at another time

    def few(path):
        with Recorder(path, topics=["event"]):
            pass

    texts = {d.topic: d.text for d in diff_runs(make(few), make(seconds=1.0)).topics}
    assert texts["/perch/belief"] == "only the second run recorded this topic"


def test_a_recording_that_ends_early_or_is_in_other_chunks_is_compared_message_by_message(make):
    def flushed(path):
        with Recorder(path) as recorder:
            for i, entry in enumerate(flight(2.0)):
                recorder(*entry)
                if i % 37 == 0:
                    recorder.flush()

    def whole(path, seconds=2.0):
        with Recorder(path) as recorder:
            for entry in flight(seconds):
                recorder(*entry)

    assert diff_runs(make(whole), make(flushed)).same_messages
    short = diff_runs(make(flushed), make(lambda path: whole(path, 1.0)))
    texts = {d.topic: (d.index, d.time_ns, d.text) for d in short.topics}
    assert texts["/perch/truth/board"] == (100, 1_000_000_000, "the first run has 100 messages more")


def test_diff_compares_score_and_manifest(make):
    difference = diff_runs(make(), make(seed=8, score={"attached": True, "metrics": {"x": 0.2}}))
    assert difference.same_messages
    assert not difference.identical
    assert difference.score == ("metrics.x is 0.1 and 0.2",)
    assert difference.manifest == ("seed is 7 and 8",)
    assert difference.lines()[0].startswith("all ")


def test_a_truncated_recording_is_not_called_equal(make):
    a, b = make(), make()
    data = (b / "run.mcap").read_bytes()
    (b / "run.mcap").write_bytes(data[: len(data) - 60_000])
    difference = diff_runs(a, b)
    assert not difference.same_messages
    assert any("second: " in line for line in difference.lines())


def test_diff_refuses_a_folder_without_a_run(make, tmp_path):
    with pytest.raises(RunError, match="no such run folder"):
        diff_runs(make(), tmp_path / "nothing")
    empty = tmp_path / "empty"
    empty.mkdir()
    write_json(empty / "manifest.json", {})
    shutil.copy(make() / "run.mcap", empty / "run.mcap")
    assert diff_runs(empty, empty).identical
