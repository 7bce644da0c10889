"""Several runs on one page: success per scenario with exact intervals, contact positions, and a row per run."""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from hil.campaign.classes import classified
from hil.campaign.lines import Group, Line, gather
from hil.campaign.power import detectable
from hil.campaign.require import Decision
from hil.recording.manifest import nested
from hil.recording.runs import Run
from hil.report.comparison_table import comparison_table, decision_table
from hil.report.drawing.section import table
from hil.report.drawing.svg import Plane
from hil.report.fault_table import fault_section
from hil.report.page import asset, template
from hil.report.sections.paper_row import number, yes
from hil.report.verdict import WHY
from hil.scoring.binomial import interval
from hil.scoring.verdict import ATTACHED, PERCHED
from kernel.toml_errors import ConfigError
from scenarios.paper import RealRow, SimulatedRow, published
from scenarios.spec import Tolerance

CONFIDENCE = 0.95
_COLOURS = {PERCHED: "#12805c", ATTACHED: "#a85b00"}
_MISSED = "#c4262e"
_AGAINST = ("impact_tangential", "normal_alignment_deg")
_MEDIANS = (  # metric, digits
    ("planar", 3), ("normal_alignment_deg", 2), ("impact_tangential", 2), ("impact_normal", 2), ("duration", 2),
)  # fmt: skip


def render(
    runs: Sequence[Run],
    title: str = "Campaign",
    baseline: str = "",
    folder: Path | None = None,
    *,
    confidence: float = CONFIDENCE,
    decisions: Sequence[Decision] = (),
    remarks: Sequence[str] = (),
) -> str:
    """The campaign's page. `baseline`: name of the policy that the others are compared with, the first if empty.
    `decisions`: what its flights say of the requirements on it. `remarks`: shown above everything.

    A run whose report is written is linked to it from the page's `folder`, the runs' own if None.
    Raises ValueError if not one run has a verdict. Flights with faults are counted by class, in a table of their own.
    """
    every, skipped = gather(runs)
    flights = classified(runs)
    with_faults = {flight.name for flight in flights}
    lines = [line for line in every if line.name not in with_faults]
    skipped = [text for text in skipped if text.partition(":")[0] not in with_faults]
    if not lines and not flights:
        raise ValueError(f"none of the {len(runs)} runs has a verdict: there is nothing to count")
    groups: dict[Group, list[Line]] = {}
    for line in sorted(lines, key=lambda line: (line.group, line.name)):
        groups.setdefault(line.group, []).append(line)
    skipped, again = _flown_again(runs, lines, skipped)
    links = _links(runs, folder)
    commits = sorted({line.commit for line in lines})
    mixed = [f"These runs are of different code: {', '.join(commits)}."] if len(commits) > 1 else []
    mixed = [*remarks, *mixed]
    mixed += [
        f"{group.scenario} with {group.policy}: {len(found) - len(seeds)} runs repeat a seed and count once more."
        for group, found in groups.items()
        if group.identity == "sim" and len(seeds := {line.manifest.get("seed") for line in found}) < len(found)
    ]
    return template("campaign.html.j2").render(
        title=title,
        css=Markup(asset("report.css")),
        runs=len(lines) + len(flights),
        confidence=f"{100 * confidence:g}",
        skipped=skipped,
        again=again,
        linked=len(links) == len(runs),
        mixed=mixed,
        scenarios=len({group.scenario for group in groups} | {flight.scenario for flight in flights}),
        summary=_summary(groups, confidence) if groups else "",
        comparison=comparison_table(lines, baseline, confidence),
        decisions=decision_table(decisions),
        faults=fault_section(flights),
        groups=[_group(group, found, links) for group, found in groups.items()],
    )


def _flown_again(runs: Sequence[Run], lines: Sequence[Line], skipped: list[str]) -> tuple[list[str], list[str]]:
    """`skipped` parted: those left out for good, and those that were cut short and flown again (a campaign resumed)."""
    counted = {_conditions(line.manifest) for line in lines}
    resumed = {run.path.name for run in runs if _conditions(run.manifest) in counted}
    again = [text for text in skipped if text.split(": ")[0] in resumed]
    return [text for text in skipped if text not in again], again


def _conditions(manifest: dict[str, Any]) -> str:
    """What a simulated run was of, to the last value; a real attempt is never another's repetition."""
    names = ("scenario", "rig", "policy", "seed") if manifest.get("identity") == "sim" else ("wall_clock",)
    return json.dumps([manifest.get(name) for name in names], sort_keys=True)


def _links(runs: Sequence[Run], folder: Path | None) -> dict[str, str]:
    """Name of a run -> its report, relative to the page; of runs of one name none."""
    names = Counter(run.path.name for run in runs)
    found = {}
    for run in runs:
        report = run.path / "report.html"
        if report.exists() and names[run.path.name] == 1:
            found[run.path.name] = quote(os.path.relpath(report, folder or run.path.parent))
    return found


def _summary(groups: dict[Group, list[Line]], confidence: float) -> Markup:
    rows: list[tuple[object, ...]] = []
    for about, group in groups.items():
        counts = [sum(line.verdict == PERCHED for line in group)]
        counts += [sum(bool(line.score[key]) for line in group) for key in ("within_tolerance", "attached")]
        rates = [_rate(count, len(group), confidence) for count in counts]
        least = detectable(len(group), counts[1] / len(group), confidence)
        rates.append(Markup("–") if least is None else Markup("{}").format(f"{100 * least:.0f} points"))
        medians = [number(_median([line.score["metrics"][key] for line in group]), digits) for key, digits in _MEDIANS]
        told = [about.identity, *(text for text in (about.camera, about.rig) if text not in ("unknown", ""))]
        tag = Markup(' <span class="tag">{}</span>').format(", ".join(told))
        link = Markup('<a href="#{}">{}</a>').format(about.ident, about.scenario) + tag
        rows.append((link, about.policy, *rates, *medians))
    head = (
        "scenario", "policy", "perched", "within tolerance", "attached", "could have seen", "planar m", "normal deg",
        "tangential m/s", "impact m/s", "time s",
    )  # fmt: skip
    return table(head, rows, "campaign")


def _rate(successes: int, runs: int, confidence: float) -> Markup:
    low, high = interval(successes, runs, confidence)
    left, width, tick = 100 * low, 100 * (high - low), 100 * successes / runs
    return Markup(
        '{} of {} <span class="small">({}–{} %)</span>'
        '<span class="interval"><i style="left:{}%;width:{}%"></i><b style="left:{}%"></b></span>'
    ).format(successes, runs, f"{100 * low:.0f}", f"{100 * high:.0f}", f"{left:.1f}", f"{width:.1f}", f"{tick:.1f}")


def _group(about: Group, group: list[Line], links: dict[str, str]) -> dict[str, Any]:
    title = nested(group[0].manifest, "scenario").get("title", about.scenario)
    if "scenario" in group[0].apart:
        title = f"{title}, {about.scenario}"
    words = {"sim": "simulated", "real": "real vehicle"}.get(about.identity, about.identity)
    words += f", {about.rig}" if about.rig else ""
    reasons = Counter(line.verdict + "".join(f"; {WHY.get(r) or r}" for r in line.score["reasons"]) for line in group)
    rows = [(text, count) for text, count in reasons.most_common()]
    return {
        "name": about.ident,
        "title": f"{title} ({words}, {about.policy})",
        "scatter": _scatter(group) + _limits(group) + _legend(group),
        "reasons": table(("outcome", "runs"), list(rows), "narrow"),
        "published": _published(group[0]),
        "table": _runs(group, links),
    }


def _scatter(group: list[Line]) -> Markup:
    """Where the magnets met the board, board frame."""
    tolerance = _tolerance(group[0]).distance
    plane = Plane((-0.32, 0.32), (-0.32, 0.32), width=380, max_height=380, name="Touchdown points in the board's frame")
    plane.axes("y, to the board's left (m)", "x, up-slope (m)", mirrored=True)
    half = nested(group[0].manifest, "scenario", "board").get("size", 0.42) / 2
    plane.polygon([(-half, -half), (half, -half), (half, half), (-half, half)], "fill:#f3ece3;stroke:#a0662f")
    plane.circle(0, 0, tolerance, "fill:rgba(18,128,92,.10);stroke:#12805c;stroke-dasharray:5 3", tip="tolerance")
    for line in group:
        m = line.score["metrics"]
        if _finite(line, "x", "y"):
            plane.dot(-m["y"], m["x"], 4, _dot(line), tip=line.name)
    return plane.svg()


def _limits(group: list[Line]) -> Markup:
    """How the runs that touched stood to the other two tolerances: speed along the board, and angle."""
    tolerance, touched = _tolerance(group[0]), [line for line in group if _finite(line, *_AGAINST)]
    speeds, angles = ([line.score["metrics"][key] for line in touched] for key in _AGAINST)
    limit = tolerance.tangential_speed, math.degrees(tolerance.angle)
    most = [
        max(1.4 * side, *(1.05 * v for v in values), 0.0) for side, values in zip(limit, (speeds, angles), strict=True)
    ]
    plane = Plane(
        (0.0, most[0]),
        (0.0, most[1]),
        width=380,
        max_height=380,
        equal=False,
        name="Sliding speed and angle at contact",
    )
    plane.axes("speed along the board (m/s)", "angle to the normal (deg)")
    corners = [(0.0, 0.0), (limit[0], 0.0), limit, (0.0, limit[1])]
    plane.polygon(corners, "fill:rgba(18,128,92,.10);stroke:#12805c;stroke-dasharray:5 3")
    for line, speed, angle in zip(touched, speeds, angles, strict=True):
        plane.dot(speed, angle, 4, _dot(line), tip=line.name)
    return plane.svg()


def _legend(group: list[Line]) -> Markup:
    """What the dots' colours mean, and how many runs have none."""
    keys = Markup(" ").join(
        Markup('<span class="key dots"><i style="--c:{}"></i>{}</span>').format(colour, words)
        for colour, words in ((_COLOURS[PERCHED], "perched"), (_COLOURS[ATTACHED], "attached, outside tolerance"),
                              (_MISSED, "missed"))
    )  # fmt: skip
    without = sum(not _finite(line, "x", "y") for line in group)
    text = f"; {without} of {len(group)} did not touch the board and have no dot" if without else ""
    return Markup(
        '<p class="small legend-row">{}</p><p class="small">First: where the magnet met the board. Second: how fast it '
        "slid and at which angle. Green: within tolerance{}.</p>"
    ).format(keys, text)


def _dot(line: Line) -> str:
    return f"fill:{_COLOURS.get(line.verdict, _MISSED)};fill-opacity:.75;stroke:#fff"


def _finite(line: Line, *keys: str) -> bool:
    values = [line.score["metrics"][key] for key in keys]
    return all(value is not None and math.isfinite(value) for value in values)


def _published(line: Line) -> Markup:
    try:
        row = published(line.manifest["scenario"]["published"])
    except (KeyError, TypeError, ConfigError, AttributeError):
        return Markup('<p class="small">This scenario names no published row.</p>')
    if isinstance(row, SimulatedRow):
        text = f"Published, simulated: {row.success_percent:g} % success, position error {row.position_error:g} m, "
        text += f"tangential {row.tangential_speed:g} m/s."
        return Markup('<p class="small">{}</p>').format(text)
    assert isinstance(row, RealRow)
    text = f"Published flight: planar {row.planar:g} m, alignment {row.normal_alignment_deg:g} deg, "
    text += f"tangential {row.impact_tangential:g} m/s"
    return Markup('<p class="small">{}.</p>').format(text)


def _runs(group: list[Line], links: dict[str, str]) -> Markup:
    rows: list[tuple[object, ...]] = []
    for line in group:
        m = line.score["metrics"]
        rows.append(
            (
                Markup('<span title="{}">{}</span>').format(line.name, line.manifest.get("seed", "–")),
                line.verdict,
                yes(line.score["within_tolerance"]),
                yes(line.score["attached"]),
                number(m["planar"], 3),
                number(m["normal_alignment_deg"], 2),
                number(m["impact_tangential"], 2),
                number(m["impact_normal"], 2),
                number(m["duration"], 2),
                number(m["blind_time"], 2),
                "; ".join(line.score["reasons"]),
                _name(line.name, links),
            )
        )
    head = (
        "seed", "verdict", "within tolerance", "attached", "planar m", "normal deg", "tangential m/s", "impact m/s",
        "time s", "blind s", "why not", "run",
    )  # fmt: skip
    return table(head, rows, "runs")


def _name(name: str, links: dict[str, str]) -> Markup:
    if name not in links:
        return Markup('<span class="small">{}</span>').format(name)
    return Markup('<a class="small" href="{}">{}</a>').format(links[name], name)


def _tolerance(line: Line) -> Tolerance:
    return Tolerance.model_validate(nested(line.manifest, "scenario", "tolerance"))


def _median(values: Sequence[float | None]) -> float | None:
    known = sorted(v for v in values if v is not None)
    if not known:
        return None
    middle = len(known) // 2
    return known[middle] if len(known) % 2 else (known[middle - 1] + known[middle]) / 2
