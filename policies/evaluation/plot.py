"""Learning curves and heat map as small SVG files, without a plotting library."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 720, 360, 56, 40, 24
_FEWEST = 20  # episodes behind a drawn point
_COLOURS = ("#06c", "#c30", "#393", "#939", "#888")

Curve = Sequence[Mapping[str, float]]
"""Lines of a run's curve: `samples`, `phase`, `episodes` and shares from 0 to 1."""


def _points(xs: list[float], ys: list[float], span: tuple[float, float], y1: float) -> str:
    def place(x: float, y: float) -> str:
        px = LEFT + (WIDTH - LEFT - 16) * (x - span[0]) / max(span[1] - span[0], 1e-9)
        return f"{px:.1f},{HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * y / max(y1, 1e-9):.1f}"

    return " ".join(place(x, y) for x, y in zip(xs, ys, strict=True) if math.isfinite(y))


def learning_curve(table: Path, drawing: Path, title: str) -> None:
    """Draw success over samples from a curve's CSV, as it is and smoothed, into an SVG.

    It is the success of the training episodes, with exploration noise and the teacher's share of the steps.
    """
    with table.open() as file:
        lines = [{k: float(v) for k, v in line.items()} for line in csv.DictReader(file)]
    xs = [line["samples"] / 1e6 for line in lines]
    ends = min(xs, default=0.0), max(xs, default=1.0)
    label = "million samples, ancestors' included; success of the episodes flown to learn from"
    raw = _line(xs, _percents(lines, "success", 0), ends, "#bcd", 1)
    drawing.write_text(_frame(title, ends, label, raw + _line(xs, percents(lines, "success"), ends, "#06c", 2)))


def comparison(curves: Mapping[str, Curve], column: str, title: str) -> str:
    """SVG of a share `column` of several curves over their samples, smoothed, by name."""
    xs = {name: [line["samples"] / 1e6 for line in lines] for name, lines in curves.items()}
    every = [x for places in xs.values() for x in places]
    ends = min(every, default=0.0), max(every, default=1.0)
    inside = ""
    for k, (name, lines) in enumerate(curves.items()):
        colour, y = _COLOURS[k % len(_COLOURS)], HEIGHT - BOTTOM - 16 * (len(curves) - k)
        inside += _line(xs[name], percents(lines, column), ends, colour, 2)
        inside += f'<path d="M{WIDTH - 200} {y - 4}h24" stroke="{colour}" stroke-width="3"/>'
        inside += f'<text x="{WIDTH - 170}" y="{y}">{escape(name)}</text>'
    return _frame(title, ends, "million samples; the episodes flown to learn from", inside)


def percents(lines: Curve, column: str) -> list[float]:
    """The share `column` of a curve in percent, by episodes over a fiftieth of its lines. Fewer than `_FEWEST` episodes
    of a phase are no share: NaN."""
    return _percents(lines, column, max(1, len(lines) // 50))


def _percents(lines: Curve, column: str, before: int) -> list[float]:
    counts = [line.get("episodes", _FEWEST) or 0.0 for line in lines]  # curves of older runs do not tell
    sums = [(line[column] or 0.0) * n if n else 0.0 for line, n in zip(lines, counts, strict=True)]
    found = []
    for i in range(len(lines)):
        part = [k for k in range(max(0, i - before), i + 1) if lines[k].get("phase") == lines[i].get("phase")]
        part = [k for k in part if math.isfinite(sums[k])]
        episodes = sum(counts[k] for k in part)
        found.append(100.0 * sum(sums[k] for k in part) / episodes if episodes >= _FEWEST else math.nan)
    return found


def _line(xs: list[float], ys: list[float], ends: tuple[float, float], colour: str, width: int) -> str:
    return f'<polyline points="{_points(xs, ys, ends, 100.0)}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def _frame(title: str, ends: tuple[float, float], label: str, inside: str) -> str:
    grid = []
    for k in range(0, 101, 20):
        y = HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * k / 100.0
        grid.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - 16}" stroke="#ddd"/>')
        grid.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{k} %</text>')
    for k in range(6):
        x, value = LEFT + (WIDTH - LEFT - 16) * k / 5.0, ends[0] + (ends[1] - ends[0]) * k / 5.0
        grid.append(f'<text x="{x:.1f}" y="{HEIGHT - 20}" text-anchor="middle">{value:.3g}</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        'font-size="12">'
        f'<rect width="100%" height="100%" fill="#fff"/><text x="{LEFT}" y="16" font-size="14">{escape(title)}</text>'
        f'{"".join(grid)}{inside}<text x="{WIDTH / 2}" y="{HEIGHT - 4}" text-anchor="middle">{label}</text></svg>\n'
    )


def heat_map(speeds: list[float], inclinations_deg: list[float], success: list[list[float]], title: str) -> str:
    """SVG of success (percent, row by inclination, column by speed) with the 50 and 70 percent contours."""
    cell_w, cell_h = 620.0 / len(speeds), 300.0 / len(inclinations_deg)
    parts = [f'<text x="8" y="18">{escape(title)}</text>']
    for j, inclination in enumerate(inclinations_deg):
        y = 330.0 - (j + 1) * cell_h
        parts.append(f'<text x="54" y="{y + 0.6 * cell_h:.1f}" text-anchor="end">{inclination:g}°</text>')
        for i in range(len(speeds)):
            value = success[j][i]
            hue = 1.2 * value
            parts.append(
                f'<rect x="{60 + i * cell_w:.1f}" y="{y:.1f}" width="{cell_w:.1f}" height="{cell_h:.1f}" '
                f'fill="hsl({hue:.0f} 60% 65%)"/><text x="{60 + (i + 0.5) * cell_w:.1f}" '
                f'y="{y + 0.6 * cell_h:.1f}" text-anchor="middle">{value:.0f}</text>'
            )
    for level, colour, width in ((50.0, "#900", 6), (70.0, "#036", 2)):  # the lower one shows where both run
        parts.append(_contour(success, level, colour, width, cell_w, cell_h))
    for i, speed in enumerate(speeds):
        parts.append(f'<text x="{60 + (i + 0.5) * cell_w:.1f}" y="346" text-anchor="middle">{speed:g}</text>')
    parts.append(
        '<text x="370" y="364" text-anchor="middle">board speed, m/s, and inclination; '
        "success in %: contour of 50 red, of 70 blue</text>"
    )
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 700 372" font-family="sans-serif" font-size="11">'
        f'<rect width="100%" height="100%" fill="#fff"/>{"".join(parts)}</svg>\n'
    )


def _contour(success: list[list[float]], level: float, colour: str, width: int, cell_w: float, cell_h: float) -> str:
    """Edges between cells on either side of a level."""
    path = []
    for j, line in enumerate(success):
        for i, value in enumerate(line):
            x, y = 60 + i * cell_w, 330.0 - (j + 1) * cell_h
            if i + 1 < len(line) and (value < level) != (line[i + 1] < level):
                path.append(f"M{x + cell_w:.1f} {y:.1f}v{cell_h:.1f}")
            if j + 1 < len(success) and (value < level) != (success[j + 1][i] < level):
                path.append(f"M{x:.1f} {y:.1f}h{cell_w:.1f}")
    return f'<path d="{"".join(path)}" stroke="{colour}" stroke-width="{width}" fill="none"/>'
