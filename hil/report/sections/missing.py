"""Topics that the recording lacks, and the plots that could not be drawn."""

from __future__ import annotations

from collections.abc import Sequence

from hil.contract.topics import TOPICS
from hil.recording.recorder import PICTURES
from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded


def build(recorded: Recorded, sections: Sequence[Section]) -> Section:
    section = Section("missing", "What is missing")
    lost = [(section.title, plot, why) for section in sections for plot, why in section.lost]
    silent = [name for name, topic in TOPICS.items() if topic.recorded and not recorded.has(name) and name != PICTURES]
    if lost:
        section.html(table(("section", "not drawn", "because"), list(lost), "left"))
    if silent:
        section.text(f"Topics of the contract without a message: {', '.join(silent)}.")
    if not lost and not silent:
        section.text("Nothing: every topic of the contract has messages, and every plot is drawn.")
    return section
