"""What the autopilot says: texts from their chunks, events."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehicle.px4.driver.texts import Texts
from vehicle.px4.event_texts import EventTexts

MS = 1_000_000


def send_text(texts, text, severity=6, id=1, now=0):
    for i in range(0, max(1, len(text)), 50):
        texts.receive(SimpleNamespace(id=id, severity=severity, chunk_seq=i // 50, text=text[i : i + 50]), now)


def taken(texts):
    return [(note.severity, note.text) for note in texts.take()]


@given(st.lists(st.text("abc defg", min_size=1, max_size=160).filter(lambda t: t.strip() and len(t) % 50), max_size=6))
def test_texts_are_assembled_from_chunks(reported):
    texts = Texts()
    for i, text in enumerate(reported):
        send_text(texts, text + "\t", id=i)
    assert [text for _, text in taken(texts)] == [f"autopilot: {text.strip()}" for text in reported]


def test_text_that_fills_its_chunk_waits_for_more_up_to_a_limit():
    texts = Texts()
    send_text(texts, "x" * 50)
    texts.flush(400 * MS)
    assert taken(texts) == []
    texts.flush(600 * MS)
    assert taken(texts) == [("info", "autopilot: " + "x" * 50)]


def test_chunks_without_a_beginning_are_dropped():
    texts = Texts()
    texts.receive(SimpleNamespace(id=4, severity=2, chunk_seq=1, text="t\t"), 0)
    assert taken(texts) == []


@pytest.fixture
def texts_and_events():
    """Texts that read EVENTs: 5 a plain one, 6 an error of the checks before arming, 7 the begin of such a report."""
    group = {"message": "No estimate", "name": "x"}
    begin = {"message": "summary", "name": "commander_arming_check_summary"}
    groups = {
        "default": {"events": {"5": {"message": "Takeoff detected", "name": "takeoff"}}},
        "arming_check": {"events": {"6": group, "7": begin}},
    }
    return Texts(EventTexts({"components": {"1": {"namespace": "px4", "event_groups": groups}}}))


def event(texts, number, level):
    texts.event(SimpleNamespace(id=1 << 24 | number, log_levels=0xF0 | level, arguments=(0,) * 40), 0)


def test_events_are_texts_and_their_copies_are_left_out(texts_and_events):
    event(texts_and_events, 5, 6)
    event(texts_and_events, 5, 8)  # meant for no reader
    event(texts_and_events, 99, 2)
    send_text(texts_and_events, "Takeoff detected\t", 6)
    send_text(texts_and_events, "of its own", 4)
    assert taken(texts_and_events) == [("info", "autopilot: Takeoff detected"), ("warning", "autopilot: of its own")]


def test_errors_of_the_newest_checks_before_arming_are_quoted(texts_and_events):
    for number, level in ((7, 8), (6, 3), (6, 3), (6, 6)):
        event(texts_and_events, number, level)
    assert texts_and_events.quote() == "; the autopilot reports: No estimate"
    assert taken(texts_and_events) == []
    event(texts_and_events, 7, 8)
    assert texts_and_events.quote() == ""


def test_texts_have_their_severity_and_errors_are_quoted():
    texts = Texts()
    for severity, text in ((2, "bad"), (4, "hm"), (6, "fine"), (2, "bad")):
        send_text(texts, text, severity)
    assert [severity for severity, _ in taken(texts)] == ["error", "warning", "info", "error"]
    assert texts.quote() == "; the autopilot reports: bad / hm"
