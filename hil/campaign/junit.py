"""A campaign's decisions as JUnit XML: a suite per requirement, a case per scenario and policy."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from xml.etree import ElementTree as ET

from hil.campaign.require import NOT_MET, UNDECIDED, Decision


def junit(name: str, decisions: Sequence[Decision]) -> str:
    """The XML, with a declaration. What is undecided is an error, not a pass."""
    top = ET.Element("testsuites", name=name)
    for requirement, group in groupby(decisions, key=lambda decision: decision.requirement):
        members = list(group)
        suite = ET.SubElement(top, "testsuite", name=requirement)
        _count(suite, members)
        for one in members:
            case = ET.SubElement(suite, "testcase", classname=one.scenario, name=one.policy, time="0.000")
            said = f"{one.successes} of {one.runs}: {one.estimate:.3f} ({one.low:.3f} to {one.high:.3f})"
            if one.outcome in (NOT_MET, UNDECIDED):
                kind = "failure" if one.outcome == NOT_MET else "error"
                ET.SubElement(case, kind, message=said, type=one.outcome).text = requirement
            ET.SubElement(case, "system-out").text = f"{said}\np met: {one.p_met:.3g}\np not met: {one.p_not:.3g}"
    _count(top, decisions)
    ET.indent(top)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(top, encoding="unicode") + "\n"


def _count(element: ET.Element, decisions: Sequence[Decision]) -> None:
    element.set("tests", str(len(decisions)))
    for name, outcome in (("failures", NOT_MET), ("errors", UNDECIDED), ("skipped", "")):
        element.set(name, str(sum(decision.outcome == outcome for decision in decisions)))
    element.set("time", "0.000")
