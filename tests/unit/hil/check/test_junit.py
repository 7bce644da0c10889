from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from hil.check.checklist import load_checklist
from hil.check.judge import Outcome
from hil.check.junit import junit, write_junit
from tests.unit.hil.check.made_up import checklist, record_of

SCHEMA = Path(__file__).parent / "junit.xsd"


@pytest.fixture
def record():
    asks = [{"ask": name} for name in "ABCDEF"]
    record = record_of(checklist(asks, [{"ask": "G", "optional": True}]))
    for entry, outcome in zip(record.entries, Outcome, strict=False):
        entry.outcome, entry.reason = outcome, "because" if outcome is not Outcome.PASS else ""
        entry.seconds = 0.5
    record.entries[6].outcome = Outcome.UNKNOWN
    return record


def validate(text: str) -> None:
    etree = pytest.importorskip("lxml.etree")
    etree.XMLSchema(etree.parse(str(SCHEMA))).assertValid(etree.fromstring(text.encode()))


def test_every_outcome_fits_the_schema(record, tmp_path):
    write_junit(tmp_path / "j.xml", record)
    validate((tmp_path / "j.xml").read_text())


def test_preflight_without_results_fits_the_junit_schema():
    text = junit(record_of(load_checklist("preflight")))
    validate(text)
    top = ET.fromstring(text)
    assert top.get("tests") == top.get("errors")


def test_outcomes_map_to_junit_elements(record):
    top = ET.fromstring(junit(record))
    kinds = {c.get("name"): [e.tag for e in c if e.tag != "system-out"] for c in top.iter("testcase")}
    got = {outcome.value: kinds[f"manual.{name}"] for name, outcome in zip("abcdef", Outcome, strict=True)}
    assert got == {
        "PENDING": ["error"],
        "PASS": [],
        "MARGINAL": [],
        "FAIL": ["failure"],
        "UNKNOWN": ["error"],
        "SKIPPED": ["skipped"],
    }
    assert kinds["manual.g"] == ["skipped"]  # optional: UNKNOWN holds nothing up


def test_counts_agree_with_the_cases(record):
    top = ET.fromstring(junit(record))
    for suite in [top, *top.iter("testsuite")]:
        cases = list(suite.iter("testcase"))
        assert int(suite.attrib["tests"]) == len(cases)
        for attribute, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
            assert int(suite.attrib[attribute]) == sum(case.find(tag) is not None for case in cases)
    assert float(top.attrib["time"]) == pytest.approx(3.0)


def test_texts_from_devices_cannot_break_the_xml(record):
    record.entries[3].reason = "\x00\x1b[31m<&]]>\ud800 caf\u00e9"
    text = junit(record)
    validate(text)
    (failure,) = ET.fromstring(text).iter("failure")
    assert failure.get("message") == "??[31m<&]]>? caf\u00e9"
