"""The paper's row: this run beside the published flight and the tolerances."""

from __future__ import annotations

import math
from typing import Any

from markupsafe import Markup

from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded
from scenarios.paper import RealRow, paper
from scenarios.spec import published_row

# field of the score's metrics and of the published row, name, unit, digits
ROWS = (
    ("platform_speed", "platform speed", "m/s", 2),
    ("inclination_deg", "inclination, set", "deg", 1),
    ("inclination_measured_deg", "inclination, held", "deg", 1),
    ("x", "terminal error x (up-slope)", "m", 3),
    ("y", "terminal error y (left)", "m", 3),
    ("planar", "terminal error, planar", "m", 3),
    ("normal_alignment_deg", "normal alignment error", "deg", 2),
    ("impact_normal", "impact velocity, normal", "m/s", 2),
    ("impact_tangential", "impact velocity, tangential", "m/s", 2),
    ("perception_desired_hz", "perception, desired", "Hz", 2),
    ("perception_actual_hz", "perception, actual", "Hz", 2),
    ("perception_found_hz", "perception, board found", "Hz", 2),
    ("duration", "duration of the attempt", "s", 2),
    ("blind_time", "blind before the end", "s", 2),
)


def number(value: Any, digits: int) -> str:
    """A number, a range of numbers, or a dash for what was not measured."""
    if value is None:
        return "–"
    if isinstance(value, list | tuple):
        low, high = (f"{v:.{digits}f}" for v in value)
        return low if low == high else f"{low} to {high}"
    return f"{value:.{digits}f}"


def build(recorded: Recorded) -> Section:
    section = Section("row", "The paper's row")
    verdict = recorded.verdict
    if verdict is None:
        section.lost.append(("the paper's row", "no score.json, and no scenario to score the recording with"))
        return section
    row = published_row(recorded.scenario) if recorded.scenario else None
    limits = {
        "planar": recorded.tolerance.distance,
        "normal_alignment_deg": math.degrees(recorded.tolerance.angle),
        "impact_tangential": recorded.tolerance.tangential_speed,
    }
    rows: list[tuple[object, ...]] = []
    for field, name, unit, digits in ROWS:
        ours, limit = verdict["metrics"].get(field), limits.get(field)
        shown: object = number(ours, digits)
        margin: object = ""
        if limit is not None and ours is not None:
            inside = ours <= limit
            shown = Markup('<b class="{}">{}</b>').format("good" if inside else "bad", shown)
            margin = gauge(ours / limit)
        theirs = number(getattr(row, field, None), 2)
        rows.append((name, unit, shown, theirs, "" if limit is None else f"≤ {limit:.2f}", margin))
    theirs = ("yes", "yes" if row.within(paper().tolerance) else "no") if isinstance(row, RealRow) else ("–", "–")
    for name, field, published in (
        ("attached", "attached", theirs[0]),
        ("within tolerance", "within_tolerance", theirs[1]),
    ):
        outcome_text = "–" if verdict["outcome"] == "incomplete" else yes(verdict[field])
        rows.append((name, "", outcome_text, published, "", ""))
    section.html(table(("", "unit", "this run", "published", "tolerance", "used of tolerance"), rows, "row"))
    if row is None:
        section.text("This scenario names no published row to compare with.")
    return section


def gauge(used: float) -> Markup:
    """A bar: how much of a tolerance was used; full and red beyond it."""
    width, css = min(used, 1.0) * 100, "good" if used <= 0.8 else "warn" if used <= 1.0 else "bad"
    return Markup('<span class="gauge"><i class="{}" style="width:{}%"></i></span> {} %').format(
        css, f"{width:.0f}", f"{100 * used:.0f}"
    )


def yes(value: bool) -> Markup:
    return Markup('<b class="good">yes</b>') if value else Markup('<b class="bad">no</b>')
