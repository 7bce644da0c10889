"""Latency from a recording: from each picture to the first action after it, and its parts."""

from hil.contract import messages as m
from hil.live.latency import Latency, bars, latencies, summary, table

MS = 1_000_000


def action(at_ms, exposure_ms):
    return (
        at_ms * MS,
        "policy/action",
        m.Action(at_ms * MS, True, (0.0, 0.0, 0.0), 9.81, "follow", exposure_ms * MS, 9.81),
    )


def detection(at_ms, exposure_ms):
    seen = m.Detection(exposure_ms * MS, True, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 0.1, 0.1, (), (), "", 0, 0)
    return at_ms * MS, "board/detection", seen


def test_latency_is_counted_to_the_first_action_after_each_picture():
    found = latencies([
        action(15, 0), detection(22, 0 + 1), action(25, 1), action(35, 1), (36 * MS, "run/stage", None),
        detection(40, 18), action(45, 18), action(55, 18),
    ])  # fmt: skip
    assert found == [Latency(21 * MS, 24 * MS), Latency(22 * MS, 27 * MS)]


def test_action_without_a_picture_has_no_latency():
    assert latencies([action(15, 0), action(25, 0)]) == []


def test_first_actions_of_the_run_and_after_a_pause_have_no_latency():
    assert latencies([detection(22, 1), action(30, 1)]) == []
    found = latencies([action(15, 0), action(25, 1), detection(88, 68), action(97, 68), action(107, 84)])
    assert found == [Latency(0, 24 * MS), Latency(0, 23 * MS)]


def test_latency_table_has_percentiles_of_both_parts():
    made = table([Latency(20 * MS, 24 * MS), Latency(20 * MS, 28 * MS), Latency(0, 60 * MS)])
    assert made["count"] == 3
    assert made["max_ms"] == 60.0
    assert made["to_detection"] == {"count": 2, "p50_ms": 20.0, "p90_ms": 20.0, "p99_ms": 20.0, "max_ms": 20.0}
    assert made["then_to_action"]["p50_ms"] == 8.0


def test_latency_table_without_pictures_has_zero_counts():
    assert table([])["count"] == 0
    assert table([])["to_detection"] == {"count": 0}


def test_latency_histogram_counts_every_value():
    made = summary([21 * MS, 24 * MS, 26 * MS, 61 * MS])
    assert made["histogram_ms"] == {"20": 2, "25": 1, "60": 1}
    assert [line.split()[-1] for line in bars(made)] == ["2", "1", "1"]
