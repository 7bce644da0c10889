"""Results of runs on a terminal and as one JSON object, beside the published row."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hil.cli.legends import FLIGHTS
from hil.scoring.binomial import interval
from hil.scoring.score import Score
from hil.scoring.verdict import ATTACHED, INCOMPLETE, MISSED, PERCHED
from scenarios.paper import RealRow, SimulatedRow, paper
from scenarios.spec import Scenario, published_row

Row = RealRow | SimulatedRow | None

# name, unit, field of Metrics and of RealRow, digits; the paper's order of columns
_ROWS = (
    ("platform speed", "m/s", "platform_speed", 2),
    ("inclination", "deg", "inclination_deg", 1),
    ("terminal error x", "m", "x", 3),
    ("terminal error y", "m", "y", 3),
    ("terminal error, planar", "m", "planar", 3),
    ("normal alignment error", "deg", "normal_alignment_deg", 2),
    ("impact velocity, normal", "m/s", "impact_normal", 2),
    ("impact velocity, tangential", "m/s", "impact_tangential", 2),
    ("perception, desired", "Hz", "perception_desired_hz", 2),
    ("perception, actual", "Hz", "perception_actual_hz", 2),
    ("perception, board found", "Hz", "perception_found_hz", 2),
    ("duration of the attempt", "s", "duration", 2),
    ("blind before the end", "s", "blind_time", 2),
    ("detection latency, median", "s", "detection_latency", 3),
)


def json_row(
    score: Score, row: Row, *, policy: str, camera: str, real_time_factor: float | None, run_dir: Path | str
) -> dict[str, Any]:
    """One run as plain tables: what `--json` prints, one object a run."""
    return {
        "scenario": score.scenario,
        "seed": score.seed,
        "policy": policy,
        "camera": camera,
        "attached": score.attached,
        "within_tolerance": score.within_tolerance,
        "verdict": score.verdict,
        "outcome": score.outcome,
        "reasons": list(score.reasons),
        "metrics": score.as_dict()["metrics"],
        "published": row.model_dump(exclude_none=True) if row else {},
        "real_time_factor": real_time_factor,
        "run_dir": str(run_dir),
    }


def run_table(score: Score, scenario: Scenario, *, real_time_factor: float | None) -> RenderableType:
    """A finished run beside the published row, then the verdict."""
    row = published_row(scenario)
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("")
    table.add_column("unit", style="dim")
    table.add_column("this run", justify="right")
    table.add_column("published", justify="right")
    table.add_column("tolerance", justify="right", style="dim")
    limits = _limits(scenario)
    for name, unit, field, digits in _ROWS:
        ours, limit = getattr(score.metrics, field), limits.get(field)
        style = "red" if limit is not None and isinstance(ours, float) and ours > limit else ""
        theirs = getattr(row, field, None)
        table.add_row(
            name,
            unit,
            Text(_number(ours, digits), style=style),
            _number(theirs, 2),
            _number(limit, 2) if limit is not None else "",
        )
    table.add_section()
    theirs = _published_verdict(row)
    decided = score.verdict != INCOMPLETE
    table.add_row("attached", "", _yes(score.attached) if decided else "-", theirs[0], "")
    table.add_row("within tolerance", "", _yes(score.within_tolerance) if decided else "-", theirs[1], "")
    tail = []
    if score.reasons:
        tail.append(f"why: {'; '.join(score.reasons)}")
    if real_time_factor is not None:
        tail.append(f"{real_time_factor:.2f} times real time")
    head = Text(f"{scenario.title}  (seed {score.seed})", style="italic")
    return Group(head, table, *(Text(line) for line in tail))


def seeds_table(scenario: Scenario, scores: Sequence[Score], *, confidence: float = 0.95) -> RenderableType:
    """Several seeds of one scenario: a line each, then the counts of those that were decided, with exact intervals."""
    table = Table(box=box.SIMPLE_HEAD, padding=0)
    for column in ("seed\n", "verdict\n", "planar\nm", "normal\ndeg", "along\nm/s", "into\nm/s", "time\ns"):
        table.add_column(column, justify="left" if column == "verdict\n" else "right", no_wrap=True)
    table.add_column("why not")
    for score in scores:
        m = score.metrics
        table.add_row(
            str(score.seed),
            _verdict(score),
            _number(m.planar, 3),
            _number(m.normal_alignment_deg, 2),
            _number(m.impact_tangential, 2),
            _number(m.impact_normal, 2),
            _number(m.duration, 2),
            "; ".join(score.reasons),
        )
    counts = Table(box=None, show_header=False)
    decided = [score for score in scores if score.verdict != INCOMPLETE]
    counts.add_row("attached", rate_text(sum(s.attached for s in decided), len(decided), confidence))
    counts.add_row("within tolerance", rate_text(sum(s.within_tolerance for s in decided), len(decided), confidence))
    head = Text(f"{scenario.title}  ({len(scores)} seeds)", style="italic")
    return Group(head, table, counts, Text(f"\n{FLIGHTS}", style="dim"))


def rate_text(successes: int, runs: int, confidence: float = 0.95) -> str:
    """`18 of 20 (68-99 %)`: the count with its exact interval."""
    if runs == 0:
        return "no runs"
    low, high = interval(successes, runs, confidence)
    return f"{successes} of {runs} ({100 * low:.0f}-{100 * high:.0f} %)"


def scenarios_table(scenarios: Sequence[Scenario]) -> Table:
    """What can be flown."""
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("name", no_wrap=True)
    table.add_column("what happens")
    for s in scenarios:
        path = s.path.kind + (" then arc" if getattr(s.path, "then", None) else "")
        facts = (
            f"{path}, {s.speed.kind} speed, board at {s.board.inclination_deg:g} deg, camera at {s.camera.rate:g} Hz"
        )
        table.add_row(s.name, Text.assemble((facts, "bold"), "\n", " ".join(s.description.split()), "\n"))
    return table


def _limits(scenario: Scenario) -> dict[str, float]:
    tolerance = scenario.tolerance
    return {
        "planar": tolerance.distance,
        "normal_alignment_deg": tolerance.angle * 57.29577951308232,
        "impact_tangential": tolerance.tangential_speed,
    }


def _published_verdict(row: Row) -> tuple[Text, Text]:
    if not isinstance(row, RealRow):
        return Text(""), Text("")
    return _yes(True), _yes(row.within(paper().tolerance))


def _number(value: float | tuple[float, float] | None, digits: int) -> str:
    if value is None:
        return "-"
    if isinstance(value, tuple):
        same = f"{value[0]:.{digits}f}" == f"{value[1]:.{digits}f}"
        return f"{value[0]:.{digits}f}" if same else f"{value[0]:.{digits}f}-{value[1]:.{digits}f}"
    return f"{value:.{digits}f}"


def _verdict(score: Score) -> Text:
    style = {PERCHED: "green", ATTACHED: "yellow", MISSED: "red"}
    return Text(score.verdict.partition(",")[0], style=style.get(score.verdict, ""))


def _yes(value: bool) -> Text:
    return Text("yes", style="green") if value else Text("no", style="red")
