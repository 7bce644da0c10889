"""Healths from the bus: entries of a wrong kind are left out, two processes of one service are found."""

import json

import pytest

from hil.live.graph import check_live_graph
from hil.live.messages.health import clean_health
from hil.live.messages.health_book import HealthBook

GOOD = {
    "service": "brain", "pid": 12, "host": "a", "session": "01", "state": "running", "now_ns": 5, "outputs": ["belief"],
    "nodes": {"policy": {"steps": 3, "late": 0, "missed": 0, "worst_ns": 1, "busy_ns": 2}}, "dropped": {"belief": 1},
    "lost": {}, "strangers": {}, "garbage": 0, "counters": {"rejected": 2}, "safe": True, "why": "",
    "clock": {"offset_ns": 0, "error_ns": 1, "date_ns": 0, "moved_ns": 0, "shared": True}, "serves": "abc",
    "cpu_s": 1.5, "memory": ["a.zenoh"], "rss_kb": 1, "own_kb": 1,
    "graph": [["policy", ["belief"], ["policy/action"], ["belief"], 0]],
}  # fmt: skip
WRONG = (None, True, -1, 2**63, 1e999, float("nan"), "x", [], [1], [[]], {}, {"a": {}}, {"a": "b"}, [["a", 1, 2, 3, 4]])


def test_health_of_a_service_is_taken_as_it_is():
    assert clean_health(GOOD) == GOOD


def test_text_can_be_published_whatever_it_was():
    clean = clean_health(json.loads('{"service": "brain", "host": "\\ud800", "why": "' + "x" * 5000 + '"}'))
    assert clean["host"] == "?"
    assert len(clean["why"]) == 1000


@pytest.mark.parametrize("key", [key for key in GOOD if key != "service"])
@pytest.mark.parametrize("wrong", WRONG, ids=repr)
def test_entry_of_a_wrong_kind_does_no_harm(key, wrong):
    clean = clean_health({**GOOD, key: wrong})
    json.dumps(clean, allow_nan=False)  # it goes into live.json
    assert sum(pace.get("late", 0) for pace in clean.get("nodes", {}).values()) >= 0
    assert sum(clean.get("lost", {}).values()) >= 0
    assert "belief" not in clean.get("memory", ())
    assert isinstance(clean.get("clock", {}).get("error_ns", 0), int | float)
    check_live_graph({"brain": {"graph": []}, "other": clean}, ["brain"])
    book = HealthBook()
    book.note({**GOOD, key: wrong})
    book.note(GOOD)


class Clock:
    def __init__(self):
        self.now_ns = 10**9

    def __call__(self):
        return self.now_ns


@pytest.fixture
def clock():
    return Clock()


def test_two_processes_of_one_service_are_found(clock):
    book = HealthBook(clock)
    for _ in range(3):
        clock.now_ns += 100_000_000
        book.note(GOOD)
        assert book.double() == ""
    book.note({**GOOD, "pid": 34, "host": "b", "session": "02"})
    assert book.double() == "two processes serve as brain: process 12 on a and process 34 on b: end one of them"
    assert book.health["brain"]["pid"] == 12
    clock.now_ns += 2_000_000_000
    assert book.double() == ""


def test_process_that_was_started_again_before_the_run_takes_the_place(clock):
    book = HealthBook(clock)
    book.note(GOOD)
    clock.now_ns += 2_000_000_000
    book.note({**GOOD, "pid": 34, "session": "02"})
    assert (book.double(), book.health["brain"]["pid"]) == ("", 34)


def test_process_that_comes_during_the_run_does_not_hide_that_the_first_has_ended(clock):
    book = HealthBook(clock)
    book.note(GOOD)
    assert book.fix() == {"brain": "01"}
    clock.now_ns += 5_000_000_000
    book.note({**GOOD, "pid": 34, "session": "02"})
    assert book.health["brain"] == {**GOOD, "received_ns": 10**9}


def test_health_of_an_unknown_service_is_not_kept(clock):
    book = HealthBook(clock)
    for number in range(100):
        book.note({**GOOD, "service": f"x{number}", "memory": [f"{number}.zenoh"]})
    assert (book.health, book.memory) == ({}, set())
