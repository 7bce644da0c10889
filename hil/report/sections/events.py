"""The log of the run: events, stages, gate trips, autopilot modes. Every time axis has the same marks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded


@dataclass(frozen=True)
class Mark:
    """One instant. `label` is written at the top of the plots, empty for none."""

    t_ns: int
    severity: str  # info, warning, error, trip, contact
    text: str
    label: str = ""


def marks(recorded: Recorded) -> list[Mark]:
    """Everything worth a line on the time axes, in order."""
    found: list[Mark] = []
    events = recorded.topics.get("event")
    for message in events.messages if events else ():
        found.append(Mark(message.stamp_ns, message.severity, f"{message.source}: {message.text}"))
    sent = recorded.topics.get("vehicle/sent")
    if sent is not None:
        for i in np.flatnonzero(sent["tripped"] != "").tolist():
            found.append(Mark(int(sent.nanoseconds()[i]), "trip", f"gate tripped: {sent['tripped'][i]}", "gate"))
    if recorded.decided_ns is not None:
        word = "contact" if recorded.touched else "end"
        found.append(Mark(recorded.decided_ns, "contact", f"the referee decides here: {word}", word))
    return sorted(found, key=lambda mark: mark.t_ns)


def phases(recorded: Recorded) -> list[tuple[int, int, str]]:
    """(start, end, name) of the run's stages, the attempt split into the policy's own phases."""
    changes: list[tuple[int, str]] = []
    stages, actions = recorded.topics.get("run/stage"), recorded.topics.get("policy/action")
    if stages:
        changes += zip(stages.nanoseconds().tolist(), stages["name"].tolist(), strict=True)
    if actions:
        end = recorded.decided_ns or recorded.window_ns[1]
        named = zip(actions.nanoseconds().tolist(), actions["phase"].tolist(), strict=True)
        of_policy = [(t, phase) for t, phase in named if phase and t <= end]
        if of_policy:
            first, last = of_policy[0][0], of_policy[-1][0]
            changes = [c for c in changes if c[0] < first or c[0] > last] + of_policy
    if recorded.decided_ns is not None:
        after = recorded.decided_ns
        changes = (
            [c for c in changes if c[0] <= after]
            + [(after, "after")]
            + [(t, "ended") for t, n in changes if n == "ended"][:1]
        )
    return _runs(sorted(changes, key=lambda change: change[0]), recorded.span_ns[1])


def _runs(changes: list[tuple[int, str]], end: int) -> list[tuple[int, int, str]]:
    out: list[tuple[int, int, str]] = []
    for t, name in changes:
        if out and out[-1][2] == name:
            continue
        if out:
            out[-1] = (out[-1][0], t, out[-1][2])
        out.append((t, end, name))
    return out


def build(recorded: Recorded) -> Section:
    section = Section("events", "Events")
    section.needs(recorded, "events on the time axes", "event")
    rows: list[tuple[object, ...]] = [
        (f"{recorded.seconds(m.t_ns):.3f}", _badge(m.severity), m.text) for m in [*marks(recorded), *_modes(recorded)]
    ]
    rows.sort(key=lambda row: float(str(row[0])))
    if rows:
        section.html(table(("s from the attempt's start", "", "what happened"), rows, "events"))
    return section


def _modes(recorded: Recorded) -> list[Mark]:
    """Changes of the state that the autopilot reports."""
    status = recorded.topics.get("vehicle/status")
    found, last = [], None
    for m in status.rows("stamp_ns", "mode", "armed", "failsafe") if status else ():
        now: tuple[Any, ...] = (m.mode, m.armed, m.failsafe)
        if now != last:
            words = f"{m.mode or 'no mode'}, {'armed' if m.armed else 'disarmed'}"
            severity = "error" if m.failsafe else "info"
            found.append(Mark(m.stamp_ns, severity, f"autopilot: {words}{', FAILSAFE' * m.failsafe}"))
            last = now
    return found


def _badge(severity: str) -> Markup:
    return Markup('<span class="badge {0}">{0}</span>').format(severity)
