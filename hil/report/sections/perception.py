"""Detections of the board: tags per picture, reliability rho, rate, and why pictures gave no detection."""

from __future__ import annotations

from collections import Counter

import numpy as np

from hil.report.drawing.charts import BAD, BELIEF, MUTED, SEEN, TimePlot
from hil.report.drawing.section import Section, table
from hil.report.recorded.columns import Columns
from hil.report.recorded.flight import Recorded

_RATE_WINDOW_S = 0.5


def build(recorded: Recorded) -> Section:
    section = Section("perception", "Tag visibility and reliability")
    if section.needs(recorded, "tags a picture, perception rate, reasons for not seeing", "board/detection"):
        detections = recorded.topics["board/detection"]
        _tags(section, detections)
        _in_picture(section, detections)
        _rate(section, recorded, detections)
    if section.needs(recorded, "reliability rho", "belief"):
        belief = recorded.topics["belief"]
        t, known = belief.nanoseconds(), belief["valid"] > 0
        plot = TimePlot("rho", "Reliability rho", "1", height=110, fixed=(0.0, 1.05))
        plot.add("rho", BELIEF, t, np.where(known, belief["rho"], np.nan))
        section.plot(plot)
        plot = TimePlot("accepted-age", "Age of the newest picture that the filter accepted", "s", height=110)
        age = (t - belief.nanoseconds("last_exposure_ns")) / 1e9
        plot.add("age", MUTED, t, np.where(known & (belief["last_exposure_ns"] > 0), age, np.nan))
        section.plot(plot)
    if recorded.has("board/detection"):
        _reasons(section, recorded, recorded.topics["board/detection"])
    return section


def _tags(section: Section, detections: Columns) -> None:
    counts = detections.lengths("tag_ids").astype(np.float64)
    t, found = detections.nanoseconds(), detections["found"] > 0
    if counts.any():
        plot = TimePlot("tags", "Tags found a picture", "tags", height=110)
        plot.add("board found", SEEN, t, np.where(found, counts, np.nan), "dots")
        plot.add("not found", BAD, t, np.where(found, np.nan, counts), "dots")
        plot.fixed = (-0.3, float(counts.max()) + 0.5)
    else:
        section.lost.append(("number of tags a picture", "the detections name no tags (a camera model, no pictures)"))
        plot = TimePlot("tags", "Board found in the picture", "1 yes, 0 no", height=90, fixed=(-0.2, 1.2))
        plot.add("found", SEEN, t, np.where(found, 1.0, np.nan), "dots")
        plot.add("not found", BAD, t, np.where(found, np.nan, 0.0), "dots")
    section.plot(plot)


def _in_picture(section: Section, detections: Columns) -> None:
    """Where in the picture the tags' corners were: leaving it at an edge is how sight is lost."""
    lengths = detections.lengths("corners_px")
    named = lengths > 0
    if not named.any() or (lengths % 2).any():  # x and y of each
        section.lost.append(("the tags' place in the picture", "the detections name no corners"))
        return
    t, rows = detections.nanoseconds(), detections.flat("corners_px")[1::2]
    first = np.cumsum(lengths[named] // 2) - lengths[named] // 2
    low, high = np.full(len(t), np.nan), np.full(len(t), np.nan)
    low[named], high[named] = np.minimum.reduceat(rows, first), np.maximum.reduceat(rows, first)
    plot = TimePlot("corners", "Rows of the picture that the tags' corners spanned", "px from the top", down=True)
    plot.add("highest corner", SEEN, t, low, "dots")
    plot.add("lowest corner", BELIEF, t, high, "dots")
    section.plot(plot)


def _rate(section: Section, recorded: Recorded, detections: Columns) -> None:
    t, found = detections.log_ns, detections["found"] > 0
    window = round(_RATE_WINDOW_S * 1e9) - 1_000_000  # a whole number of periods must not count one more
    plot = TimePlot("rate", f"Perception rate over the last {_RATE_WINDOW_S:g} s", "Hz", height=120)
    for name, colour, chosen in (("pictures looked at", MUTED, t), ("board found", SEEN, t[found])):
        counts = np.searchsorted(chosen, t, side="right") - np.searchsorted(chosen, t - window, side="right")
        young = t - t[0] < window
        plot.add(
            name, colour, t, np.where(young, np.nan, counts / _RATE_WINDOW_S), "dash" if colour == MUTED else "line"
        )
    if recorded.scenario:
        plot.lines.append((recorded.scenario.camera.rate, "desired"))
    section.plot(plot)


def _reasons(section: Section, recorded: Recorded, detections: Columns) -> None:
    chosen = recorded.during(detections.nanoseconds())
    total = int(chosen.sum())
    if total == 0:
        return
    seen = zip((detections["found"][chosen] > 0).tolist(), detections["reason"][chosen].tolist(), strict=True)
    counts = Counter("board found" if found else reason or "no reason given" for found, reason in seen)
    rows: list[tuple[object, ...]] = [
        (name, count, f"{100 * count / total:.0f} %") for name, count in counts.most_common()
    ]
    section.html(table(("outcome of a picture, during the attempt", "pictures", "share"), rows, "narrow"))
