"""The verdict in words, and the handful of numbers that carry it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil.report.recorded.flight import Recorded
from hil.report.sections.paper_row import number

WHY = {
    "ground": "it came too low",
    "workspace": "it left the workspace",
    "time": "the time ran out",
    "behind": "it met the board from behind",
    "distance": "it touched too far from the board's centre",
    "tangential_speed": "it touched while sliding too fast along the board",
    "alignment": "it touched at too large an angle to the board's normal",
    "not_finite": "its pose was lost",
}


@dataclass(frozen=True)
class Tile:
    name: str
    value: str
    limit: str
    css: str  # good, bad, or empty


@dataclass(frozen=True)
class Verdict:
    """`css` good, warn, bad or unknown."""

    css: str
    headline: str
    why: str
    tiles: tuple[Tile, ...]
    source: str


def verdict(recorded: Recorded) -> Verdict:
    """What the referee said, as a crew reads it."""
    score = recorded.verdict
    source = "from score.json" if recorded.score else "scored from the recording" if score else ""
    if score is None:
        return _bare(recorded)
    reasons = "; ".join(WHY.get(r) or str(r) for r in score["reasons"])
    if score["within_tolerance"] and score["attached"]:
        css, headline = "good", "Perched within tolerance"
    elif score["within_tolerance"]:
        css, headline = "warn", "Within tolerance, but the magnet did not hold"
    elif score["attached"]:
        css, headline = "warn", "Attached, but outside tolerance"
    elif score["outcome"] == "incomplete":
        css, headline = "unknown", "No verdict"
    else:
        css, headline = "bad", "Not perched"
    metrics, limits = score["metrics"], recorded.tolerance
    tiles = (
        _tile("from the centre", metrics["planar"], 3, "m", limits.distance),
        _tile("sliding", metrics["impact_tangential"], 2, "m/s", limits.tangential_speed),
        _tile("off the normal", metrics["normal_alignment_deg"], 1, "°", math.degrees(limits.angle)),
        _tile("into the board", metrics["impact_normal"] and -metrics["impact_normal"], 2, "m/s"),
        _tile("attempt", metrics["duration"], 2, "s"),
        _tile("blind at the end", metrics["blind_time"], 2, "s"),
    )
    return Verdict(css, headline, reasons, tiles, source)


def _bare(recorded: Recorded) -> Verdict:
    contacts = recorded.topics.get("referee/contact")
    decided = [m for m in contacts.messages if m.outcome != "ongoing"] if contacts else []
    if not decided:
        return Verdict(
            "unknown", "No verdict", "neither a score nor the referee's decision is in this recording", (), ""
        )
    m = decided[0]
    css = "good" if m.within_tolerance and m.attached else "warn" if m.attached else "bad"
    words = "Perched" if m.attached else "Not perched"
    words += ", within tolerance" if m.within_tolerance else ", outside tolerance"
    return Verdict(css, words, WHY.get(m.reason, str(m.reason)), (), "from the referee's message; tolerances unknown")


def _tile(name: str, value: float | None, digits: int, unit: str, limit: float | None = None) -> Tile:
    css = "" if limit is None or value is None else "good" if value <= limit else "bad"
    shown = number(value, digits)
    limit_text = f"tolerance {limit:.{min(digits, 2)}f} {unit}" if limit is not None else ""
    return Tile(name, f"{shown} {unit}" if value is not None else shown, limit_text, css)
