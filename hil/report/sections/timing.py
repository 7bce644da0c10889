"""Regularity of every topic during the attempt: rate against the contract, worst gap."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from hil.contract.topics import TOPICS
from hil.recording.recorder import PICTURES
from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded

_LATE = 2.5  # periods without a message that count as a gap


def build(recorded: Recorded) -> Section:
    section = Section("timing", "Regularity of the topics")
    rows: list[tuple[object, ...]] = []
    for name, topic in TOPICS.items():
        columns = recorded.topics.get(name)
        if columns is None or topic.hz <= 0 or name == PICTURES:
            continue
        hz = topic.hz
        if name == "board/detection" and recorded.scenario:
            hz = recorded.scenario.camera.rate
        log = columns.published_ns[recorded.during(columns.published_ns)]
        if len(log) < 2:
            rows.append((name, f"{hz:g}", len(log), "–", "–", "–"))
            continue
        gaps = np.diff(log) / 1e6
        late = int((gaps > _LATE * 1000 / hz).sum())
        worst = float(gaps.max())
        rows.append((name, f"{hz:g}", len(log), f"{1000 / np.mean(gaps):.1f}", f"{worst:.1f}", _warned(late)))
    if rows:
        head = (
            "topic, during the attempt",
            "contract Hz",
            "messages",
            "Hz",
            "worst gap ms",
            f"gaps over {_LATE:g} periods",
        )
        section.html(table(head, rows, "narrow"))
    _steps(section, recorded)
    return section


def _steps(section: Section, recorded: Recorded) -> None:
    """Late and missed steps of each node of a live run; there are none in virtual time."""
    rows: list[tuple[object, ...]] = []
    for service, one in recorded.live.get("services", {}).items():
        for node, pace in one.get("nodes", {}).items():
            lost = sum(one.get("dropped", {}).values()) + sum(one.get("lost", {}).values())
            worst = f"{pace.get('worst_ns', 0) / 1e6:.1f}"
            late, missed = (_warned(pace.get(key, 0)) for key in ("late", "missed"))
            rows.append((node, service, pace.get("steps", "–"), late, missed, worst, _warned(lost)))
    if rows:
        head = ("node", "service", "steps", "late", "missed", "worst ms", "messages lost or dropped")
        section.html(table(head, rows, "narrow"))
        for remark in recorded.live.get("remarks", ()):
            section.text(str(remark))
    elif recorded.manifest.get("host") == "live":
        section.lost.append(("late and missed steps of each node", "no live.json beside the recording"))


def _warned(count: int) -> Markup:
    return Markup('<b class="warn">{}</b>').format(count) if count else Markup("0")
