import json
import os
from datetime import UTC, datetime

import pytest

from hil.check import records
from hil.check.judge import Outcome
from hil.check.moment import Moment
from hil.check.records import GO, INCOMPLETE, NO_GO, RecordError
from tests.unit.hil.check.made_up import checklist, record_of, run_session

NOW = Moment(datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC), "boot", 7)


@pytest.fixture
def record(tmp_path):
    made = checklist([{"ask": "A"}, {"ask": "B"}])
    record = record_of(made)
    run_session(made, record, tmp_path)
    return record


def test_record_round_trips_through_its_file(record, tmp_path):
    record.sign("Ann", NOW)
    records.write(tmp_path / "deep" / "r.json", record)
    again = records.read(tmp_path / "deep" / "r.json")
    assert again == record
    assert again.genuine()
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["r.json"]


def test_record_is_incomplete_until_signed(record, tmp_path):
    assert json.loads((tmp_path / "record.json").read_text())["state"] == "incomplete"
    record.sign(" Ann ", NOW)
    assert record.as_dict()["state"] == "sealed"
    assert record.sign_off["operator"] == "Ann"
    assert record.sign_off["utc"] == "2026-01-02T03:04:05Z"


def test_signing_without_a_name_raises(record):
    with pytest.raises(RecordError, match="name"):
        record.sign("  ", NOW)


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["entries"][0].update(outcome="SKIPPED"),
        lambda d: d["entries"].pop(),
        lambda d: d["subject"].update(rig="other"),
        lambda d: d["subject"].update(scenario_class="hard"),
        lambda d: d["sign_off"].update(operator="Bob"),
        lambda d: d["sign_off"].update(utc="2026-01-03T03:04:05Z"),
        lambda d: d["sign_off"].update(boot="another"),
        lambda d: d["sign_off"].update(uptime_ns=8),
        lambda d: d["autopilot"].update(uid="another"),
        lambda d: d.update(started_utc="2026-01-03T03:04:05Z"),
    ],
)
def test_change_after_signing_is_detected(record, tmp_path, change):
    record.sign("Ann", NOW)
    table = record.as_dict()
    change(table)
    path = tmp_path / "r.json"
    path.write_text(json.dumps(table))
    assert not records.read(path).genuine()


def test_verdict_in_the_file_follows_the_items(record):
    assert (record.exit_code(), record.content()["verdict"]) == (GO, "go")
    record.entries[0].outcome = Outcome.UNKNOWN
    assert (record.exit_code(), record.content()["verdict"]) == (INCOMPLETE, "incomplete")
    record.entries[1].outcome = Outcome.FAIL
    assert (record.exit_code(), record.content()["verdict"]) == (NO_GO, "no-go")
    assert record.content()["counts"] == {"FAIL": 1, "UNKNOWN": 1}


@pytest.mark.parametrize("text", ["", "[]", "{}", "{", '{"format": 1}', '{"format": 9}', "\0"])
def test_error_names_a_file_that_is_not_a_record(tmp_path, text):
    path = tmp_path / "r.json"
    path.write_text(text)
    with pytest.raises(RecordError, match=r"r\.json"):
        records.read(path)


def test_a_damaged_outcome_or_sign_off_is_refused(record, tmp_path):
    record.sign("Ann", NOW)
    for change in ({"sign_off": {"operator": "Ann"}}, {"entries": [{"key": "x"}]}, {"entries": None}):
        path = tmp_path / "r.json"
        path.write_text(json.dumps({**record.as_dict(), **change}))
        with pytest.raises(RecordError):
            records.read(path)


def test_a_write_that_fails_leaves_the_old_record(record, tmp_path, monkeypatch):
    path = tmp_path / "record.json"
    before = path.read_text()

    def full(fd):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    record.entries[0].outcome = Outcome.FAIL
    with pytest.raises(RecordError, match="No space left"):
        records.write(path, record)
    assert path.read_text() == before


def test_records_are_found_newest_first_and_other_files_skipped(record, tmp_path):
    folder = tmp_path / "checks"
    for name, started in (("a", "2026-01-01T00:00:00Z"), ("b", "2026-01-03T00:00:00Z"), ("c", "2026-01-02T00:00:00Z")):
        record.started_utc = started
        records.write(folder / f"{name}.json", record)
    (folder / "d.json").write_text("rubbish")
    assert [path.stem for path, _ in records.find(folder, lambda r: True)] == ["b", "c", "a"]
    assert records.find(tmp_path / "nowhere", lambda r: True) == []


@pytest.mark.parametrize(
    ("value", "unit", "found"),
    [
        (None, "m", ""),
        (True, "", "yes"),
        (False, "", "no"),
        (64.61049, "GB", "64.61 GB"),
        (1.27e-14, "deg", "0 deg"),
        (0.000242, "s", "0.000242 s"),
        (3, "tags", "3 tags"),
        ("OFFBOARD", "", "OFFBOARD"),
    ],
)
def test_what_was_found_is_read_with_four_digits_and_its_unit(record, value, unit, found):
    entry = record.entries[0]
    entry.value, entry.unit = value, unit
    assert entry.found == found
