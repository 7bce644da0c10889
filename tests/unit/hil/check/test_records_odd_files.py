"""Files in the records' folder that are not records: each is named, none stops the reading of the others."""

import json
import os

import pytest

from hil.check import records
from hil.check.checklist import Checklist
from hil.check.records import RecordError
from hil.check.session import new_record

SUBJECT = {"rig": "bench", "policy": {"name": "planner"}, "scenario": "hard-i"}


@pytest.fixture
def table(tmp_path):
    made = Checklist.model_validate({"title": "one", "group": [{"title": "g", "item": [{"ask": "Well?"}]}]})
    path = tmp_path / "good.json"
    records.write(path, new_record(made, SUBJECT))
    return json.loads(path.read_text())


ODD_FIELDS = [
    {"subject": []},
    {"subject": {"rig": float("nan")}},
    {"subject": {"rig": float("inf")}},
    {"started_utc": 5},
    {"sessions": "x"},
    {"autopilot": []},
    {"sign_off": []},
    {"sign_off": {"operator": 1, "utc": "", "sha256": ""}},
    {"entries": [1]},
    {"entries": {"a": 1}},
]


@pytest.mark.parametrize("change", ODD_FIELDS, ids=str)
def test_field_of_a_wrong_type_is_a_record_error(table, tmp_path, change):
    path = tmp_path / "odd.json"
    path.write_text(json.dumps({**table, **change}))
    with pytest.raises(RecordError, match=r"odd\.json"):
        records.read(path)
    assert [p.name for p, _ in records.find(tmp_path, lambda r: True)] == ["good.json"]


def test_unreadable_record_files_raise_record_errors(table, tmp_path, monkeypatch):
    monkeypatch.setattr(records, "_LARGEST", 1 << 20)
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "link.json").symlink_to(tmp_path / "nowhere")
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "deep.json").write_text("[" * 100_000)
    (tmp_path / "large.json").write_text(" " * (2 << 20))
    (tmp_path / "number.json").write_text("1" * 5000)
    for name in ("pipe", "folder", "link", "bytes", "deep", "large", "number"):
        with pytest.raises(RecordError, match=name):
            records.read(tmp_path / f"{name}.json")
    assert [p.name for p, _ in records.find(tmp_path, lambda r: True)] == ["good.json"]
