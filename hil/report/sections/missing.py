"""Topics that the recording lacks, and the plots that could not be drawn."""

from __future__ import annotations

from collections.abc import Sequence

from hil.contract.topics import TOPICS
from hil.recording.recorder import PICTURES
from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded

_MAY_LACK = (PICTURES, "run/fault")  # pictures are an option, and most runs have no faults


def build(recorded: Recorded, sections: Sequence[Section]) -> Section:
    section = Section("missing", "What is missing")
    lost = [(section.title, plot, why) for section in sections for plot, why in section.lost]
    wanted = [name for name, topic in TOPICS.items() if topic.recorded and name not in _MAY_LACK]
    silent = [name for name in wanted if not recorded.has(name)]
    if lost:
        section.html(table(("section", "not drawn", "because"), list(lost), "left"))
    if silent:
        section.text(f"Topics of the contract without a message: {', '.join(silent)}.")
    if not lost and not silent:
        section.text("Nothing: every topic of the contract has messages, and every plot is drawn.")
    return section
