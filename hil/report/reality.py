"""The page of a comparison of recorded runs with their simulated twins."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from hil.campaign.reality import Difference
from hil.report.drawing.section import table
from hil.report.page import asset

_PAGE = Markup(
    '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>Reality</title>\n<link rel="icon" '
    'href="data:,">\n<style>{}</style>\n</head>\n<body class="one">\n<header><div class="head"><h1>Recorded and '
    'simulated</h1>\n<div class="facts"><span>runs <b>{}</b></span></div></div></header>\n<main><section>{}\n'
    '<p class="small">Each run was flown again in simulation on the same board motion and commands. Median of each '
    "quantity (mean of a rate); distance: recorded less simulated, with its 95 % bootstrap interval; bold where the "
    "interval leaves 0 out. Recorded: {}.</p></section></main>\n</body>\n</html>\n"
)


def write_page(path: Path, runs: Sequence[str], found: Sequence[Difference]) -> Path:
    """Write it. Raises OSError."""
    rows: list[tuple[object, ...]] = []
    for one in found:
        interval = "–" if one.low is None or one.high is None else f"{one.low:+.3g} to {one.high:+.3g}"
        numbers = ["–" if value is None else f"{value:.4g}" for value in (one.real, one.twin, one.distance)]
        name = Markup("<b>{}</b>").format(one.name) if one.differs else one.name
        rows.append((name, one.unit, *numbers, interval, f"{one.samples[0]} / {one.samples[1]}"))
    head = ("quantity", "unit", "recorded", "twin", "distance", "interval", "samples")
    css = Markup(asset("report.css"))
    path.write_text(_PAGE.format(css, len(runs), table(head, rows, "left"), ", ".join(runs)), encoding="utf-8")
    return path
