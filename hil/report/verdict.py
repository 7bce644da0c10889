"""The verdict in words, with the numbers that it rests on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil.report.recorded.flight import Recorded
from hil.report.sections.paper_row import number
from hil.scoring.verdict import ATTACHED, INCOMPLETE, MISSED, PERCHED, verdict_word

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

_HEADLINES = {
    PERCHED: ("good", "Perched"),
    ATTACHED: ("warn", "Attached, outside tolerance"),
    MISSED: ("bad", "Missed"),
    INCOMPLETE: ("unknown", "No verdict"),
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
    """The referee's verdict as the page's headline."""
    score = recorded.verdict
    source = "from score.json" if recorded.score else "scored from the recording" if score else ""
    if score is None:
        return _bare(recorded)
    reasons = "; ".join(WHY.get(r) or str(r) for r in score["reasons"])
    word = verdict_word(
        attached=score["attached"], within_tolerance=score["within_tolerance"], outcome=score["outcome"],
        state=str(recorded.manifest.get("state", "finished")),
    )  # fmt: skip
    css, headline = _HEADLINES[word]
    if word == MISSED and score["within_tolerance"]:
        headline += ": within tolerance, but not attached"
    if word == INCOMPLETE and score["outcome"] != INCOMPLETE:
        headline = f"Not counted: the run's state is {recorded.manifest['state']}"
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
    css, headline = _HEADLINES[
        verdict_word(attached=m.attached, within_tolerance=m.within_tolerance, outcome=m.outcome)
    ]
    return Verdict(
        css, headline, WHY.get(m.reason, str(m.reason)), (), "from the referee's message; tolerances unknown"
    )


def _tile(name: str, value: float | None, digits: int, unit: str, limit: float | None = None) -> Tile:
    css = "" if limit is None or value is None else "good" if value <= limit else "bad"
    shown = number(value, digits)
    limit_text = f"tolerance {limit:.{min(digits, 2)}f} {unit}" if limit is not None else ""
    return Tile(name, f"{shown} {unit}" if value is not None else shown, limit_text, css)
