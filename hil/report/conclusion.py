"""What a campaign's folder says: counts, comparisons, classes of flights with faults, requirements, and the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.campaign.classes import classified, counts
from hil.campaign.draw import compare_list
from hil.campaign.junit import junit
from hil.campaign.lines import Line, gather
from hil.campaign.require import Decision, Requirement, as_rows, decide, overall
from hil.recording.runs import list_runs
from hil.report.campaign import render
from hil.report.comparison_table import comparisons
from hil.scoring.binomial import interval
from hil.scoring.flight_class import UNSAFE


@dataclass(frozen=True)
class Conclusion:
    """Everything that is printed. `outcome`: of all requirements together, empty without any."""

    page: Path
    confidence: float
    counts: list[dict[str, Any]]
    classes: list[dict[str, Any]]
    comparisons: list[tuple[str, str, str, str]]
    decisions: list[Decision]
    outcome: str
    unsafe: int

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        fields = ("policy", "against", "scenario", "says")
        compared = [dict(zip(fields, row, strict=True)) for row in self.comparisons]
        found = {"counts": self.counts, "comparisons": compared, "faults": self.classes, "unsafe": self.unsafe}
        decided = {"outcome": self.outcome, "requirements": as_rows(self.decisions)} if self.outcome else {}
        return {**found, **decided, "confidence": self.confidence, "page": str(self.page)}


def conclude(
    out: Path,
    baseline: str,
    requirements: Sequence[Requirement],
    confidence: float,
    *,
    xml: Path | None = None,
    listed: dict[str, Any] | None = None,
) -> Conclusion | None:
    """Judge everything that the folder `out` holds, write its page, and JUnit to `xml`; None if it holds no result.
    `listed`: the sealed list with which its real flights are compared.

    Raises ValueError for requirements that its flights say nothing about, RunError or OSError for unreadable files.
    """
    runs = list_runs(out)
    lines, _ = gather(runs)
    flights = classified(runs)
    if not lines and not flights:
        return None
    plain = [line for line in lines if not line.group.fault]
    decisions = decide(lines, requirements, baseline, confidence) if requirements else []
    remarks = compare_list(listed, lines) if listed else []
    page = out / "campaign.html"
    title = f"Campaign {out.resolve().name}"
    page.write_text(
        render(runs, title, baseline, confidence=confidence, decisions=decisions, remarks=remarks), encoding="utf-8"
    )
    if xml is not None:
        xml.write_text(junit(title, decisions), encoding="utf-8")
    return Conclusion(
        page, confidence, _counts(plain, confidence), counts(flights), comparisons(plain, baseline, confidence),
        decisions, overall(decisions) if decisions else "",
        sum(flight.counts and flight.flight_class == UNSAFE for flight in flights),
    )  # fmt: skip


def _counts(lines: Sequence[Line], confidence: float) -> list[dict[str, Any]]:
    found: dict[Any, list[Line]] = {}
    for line in lines:
        found.setdefault(line.group, []).append(line)
    rows = []
    for group, members in sorted(found.items()):
        row: dict[str, Any] = {**group._asdict(), "runs": len(members)}
        for key in ("within_tolerance", "attached"):
            row[key] = sum(bool(line.score[key]) for line in members)
            row[f"{key}_interval"] = interval(row[key], len(members), confidence)
        rows.append(row)
    return rows
