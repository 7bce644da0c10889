"""A record as JUnit XML: a suite per group, a case per item. An unknown item is an error, not a pass."""

from __future__ import annotations

import re
from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree as ET

from hil.check.judge import Outcome
from hil.check.records import Entry, Record, passed

_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(record: Record) -> str:
    """The XML, with a declaration."""
    subject = record.subject
    top = ET.Element("testsuites", name=_clean(f"{subject['list']} ({subject['rig']}, {subject['scenario']})"))
    for title, entries in groupby(record.entries, key=lambda entry: entry.group):
        members = list(entries)
        suite = ET.SubElement(top, "testsuite", name=_clean(title), timestamp=record.started_utc.rstrip("Z"))
        _count(suite, members)
        for entry in members:
            _case(suite, entry)
    _count(top, record.entries)
    ET.indent(top)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(top, encoding="unicode") + "\n"


def write_junit(path: Path, record: Record) -> None:
    """Write it. Raises OSError."""
    path.write_text(junit(record), encoding="utf-8")


def _count(element: ET.Element, entries: list[Entry]) -> None:
    element.set("tests", str(len(entries)))
    for name, kind in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        element.set(name, str(sum(_kind(entry) == kind for entry in entries)))
    element.set("time", f"{sum(entry.seconds or 0.0 for entry in entries):.3f}")


def _kind(entry: Entry) -> str:
    if entry.outcome is Outcome.FAIL:
        return "failure"
    if entry.outcome is Outcome.SKIPPED or (entry.outcome is Outcome.UNKNOWN and passed(entry)):
        return "skipped"
    return "error" if entry.outcome in (Outcome.UNKNOWN, Outcome.PENDING) else ""


def _case(suite: ET.Element, entry: Entry) -> None:
    case = ET.SubElement(
        suite, "testcase", classname=_clean(entry.group), name=_clean(entry.key), time=f"{entry.seconds or 0.0:.3f}"
    )
    kind = _kind(entry)
    message = _clean(entry.reason or entry.detail or ("not reached" if entry.outcome is Outcome.PENDING else ""))
    if kind == "skipped":
        ET.SubElement(case, "skipped", message=message)
    elif kind:
        ET.SubElement(case, kind, message=message, type=entry.outcome.value).text = _clean(entry.title)
    facts = {
        "outcome": entry.outcome.value,
        "value": entry.value,
        "unit": entry.unit,
        "limit": entry.limit,
        "margin": entry.margin,
        "source": entry.source,
        "operator": entry.operator,
        "utc": entry.utc,
        "detail": entry.detail,
    }
    lines = [f"{name}: {value}" for name, value in facts.items() if value not in (None, "")]
    ET.SubElement(case, "system-out").text = _clean("\n".join(lines))


def _clean(text: str) -> str:
    return _ILLEGAL.sub("?", text)
