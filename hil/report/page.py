"""Assembles a report: `flight_page(run)`, `compare_page(a, b)`. One HTML text that loads nothing from outside."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from hil.recording.manifest import board_known_by, nested
from hil.report.drawing.charts import Pack, TimePlot
from hil.report.drawing.section import Section
from hil.report.recorded.flight import Recorded
from hil.report.sections import build_all
from hil.report.sections.events import marks, phases
from hil.report.verdict import verdict

_HERE = Path(__file__).parent


def render(recorded: Sequence[Recorded]) -> str:
    """The page of one flight, or of two side by side."""
    pack = Pack()
    rows = [_row(pack, recorded, cells) for cells in zip(*map(build_all, recorded), strict=True) if any(cells)]
    flights = [_head(flight) for flight in recorded]
    title = " against ".join(flight.name for flight in recorded)
    data = embedded({**pack.table(), "flights": [_axis(flight) for flight in recorded]})
    del pack  # as large as the page
    return template("flight.html.j2").render(
        title=title,
        flights=flights,
        rows=rows,
        css=Markup(asset("report.css")),
        script=Markup(asset("plots.js") + asset("scene.js")),
        data=data,
    )


def _row(pack: Pack, recorded: Sequence[Recorded], cells: Sequence[Section]) -> dict[str, Any]:
    """One section: of one flight in its order, of several with text and figures side by side over joint plots."""
    alone = len(cells) == 1
    by_key = [{part.key: part for part in section.parts if isinstance(part, TimePlot)} for section in cells]
    joint = dict.fromkeys(key for plots in by_key for key in plots)
    drawn = {key: _figure(pack, [(r, of.get(key)) for r, of in zip(recorded, by_key, strict=True)]) for key in joint}
    row = {
        "ident": cells[0].ident,
        "title": cells[0].title,
        "cells": [
            {
                "parts": [
                    drawn[part.key] if isinstance(part, TimePlot) else part
                    for part in section.parts
                    if alone or not isinstance(part, TimePlot)
                ],
                "lost": section.lost if section.ident != "missing" else [],
            }
            for section in cells
        ],
        "joint": [] if alone else list(drawn.values()),
    }
    for section in cells:
        section.parts.clear()  # their plots are packed
    return row


def _figure(pack: Pack, flights: list[tuple[Recorded, TimePlot | None]]) -> Markup:
    ident = pack.add(flights)
    height = pack.plots[-1]["height"]
    return Markup('<figure class="plot" id="{}" style="min-height:{}px"></figure>').format(ident, height)


def _head(recorded: Recorded) -> dict[str, Any]:
    manifest, scenario = recorded.manifest, recorded.scenario
    facts = [
        ("scenario", nested(manifest, "scenario").get("name")),
        ("seed", manifest.get("seed")),
        ("policy", nested(manifest, "policy").get("name")),
    ]
    facts += [
        ("detections from", _detections(nested(manifest, "rig"))),
        ("board known by", "motion capture" if board_known_by(nested(manifest, "rig")) == "mocap" else None),
        ("rig", nested(manifest, "rig").get("title")),
        ("host", manifest.get("host")),
        ("flown", _moment(nested(manifest, "wall_clock").get("started_utc"))),
        ("attempt began", _attempt_moment(recorded)),
    ]
    faults = list(recorded.recording.faults)
    if not recorded.recording.complete and not faults:
        faults.append("the writer did not finish it")
    if faults:
        faults += [str(gap) for gap in recorded.recording.missing()]
    return {
        "name": recorded.name,
        "title": scenario.title if scenario else recorded.name,
        "identity": {"sim": "simulated", "real": "real vehicle"}.get(manifest.get("identity", ""), "origin unknown"),
        "facts": [(name, value) for name, value in facts if value is not None],
        "verdict": verdict(recorded),
        "faults": faults,
        "state": manifest.get("state", "finished") if manifest else "finished",
        "notes": recorded.notes,
    }


def _axis(recorded: Recorded) -> dict[str, Any]:
    """The time axis's ranges, marks and phases, in seconds from the attempt's start."""
    start, end = recorded.window_ns
    first, last = recorded.span_ns

    def s(t_ns: int) -> float:
        return round(float(recorded.seconds(t_ns)), 4)

    return {
        "name": recorded.name,
        "home": [s(start) - 0.1, s(end)],
        "full": [s(first), s(last)],
        "decided": s(recorded.decided_ns) if recorded.decided_ns is not None else None,
        "marks": [[s(m.t_ns), m.severity, m.text, m.label] for m in marks(recorded)],
        "phases": [[s(a), s(b), name] for a, b, name in phases(recorded)],
    }


def _detections(rig: dict[str, Any]) -> str | None:
    """What the detections were found in."""
    real = nested(rig, "camera").get("kind") != "sim"
    names = {"pictures": "real pictures" if real else "drawn pictures", "model": "the paper's noise model, no pictures"}
    return names.get(board_known_by(rig))


def _attempt_moment(recorded: Recorded) -> str | None:
    """Wall time of the plots' 0 s; None in virtual time, or if it is not known."""
    tables = (nested(recorded.manifest, "wall_clock"), recorded.recording.metadata.get("wall_clock", {}))
    zero = next((table["zero_utc"] for table in tables if "zero_utc" in table), None)
    if recorded.manifest.get("host", "live") != "live" or recorded.attempt_ns is None or not isinstance(zero, str):
        return None
    try:
        began = datetime.fromisoformat(zero) + timedelta(microseconds=recorded.attempt_ns / 1e3)
    except ValueError:
        return None
    return f"{began:%H:%M:%S}.{began.microsecond // 1000:03d} UTC"


def _moment(text: str | None) -> str | None:
    """`2026-01-02T03:04:05.678+00:00` as a reader likes it."""
    return f"{text[:10]} {text[11:19]} UTC" if isinstance(text, str) and text.endswith("+00:00") else text


@cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(_HERE / "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def template(name: str) -> Any:
    """A page's template."""
    return _environment().get_template(name)


def asset(name: str) -> str:
    """A file that is written into the page."""
    return (_HERE / "assets" / name).read_text(encoding="utf-8")


def embedded(data: Any) -> Markup:
    """JSON that may stand in a script element."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace("\u2028", "\\u2028"))
