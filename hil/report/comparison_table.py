"""Policies of a campaign, compared on the seeds that both flew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from hil.campaign.lines import Line
from hil.campaign.power import detectable_gain
from hil.campaign.require import Decision
from hil.report.drawing.section import table
from hil.scoring.comparison import Pairs, pair, words

Conditions = tuple[str, str, Any]  # scenario, camera and rig, seed


def outcomes(lines: Sequence[Line]) -> dict[str, dict[Conditions, bool]]:
    """policy -> conditions -> within tolerance, of the simulated runs: only these have seeds that can be repeated."""
    found: dict[str, dict[Conditions, bool]] = {}
    for line in lines:
        about = line.group
        if about.identity == "sim":
            key = (about.scenario, f"{about.camera} {about.rig}", line.manifest.get("seed"))
            found.setdefault(about.policy, {})[key] = bool(line.score["within_tolerance"])
    return found


def comparisons(lines: Sequence[Line], baseline: str, confidence: float) -> list[tuple[str, str, str, str]]:
    """(policy, baseline, scenario or "all", result of the pairs), where there is anything to pair."""
    by_policy = outcomes(lines)
    names = sorted(by_policy, key=lambda name: (name.split(" ")[0] != baseline, name))
    rows = []
    for name in names[1:]:
        first, second = by_policy[names[0]], by_policy[name]
        scenarios = sorted({key[0] for key in first.keys() & second.keys()})
        for scenario in [*scenarios, *(["all"] if len(scenarios) > 1 else [])]:
            pairs = pair(_of(first, scenario), _of(second, scenario))
            rows.append((name, names[0], scenario, words(pairs, confidence) + _could_see(pairs, confidence)))
    return rows


def comparison_table(lines: Sequence[Line], baseline: str, confidence: float) -> Markup:
    """The same as a table; empty if there is only one policy."""
    rows: list[tuple[object, ...]] = [*comparisons(lines, baseline, confidence)]
    return table(("policy", "against", "scenario", "within tolerance"), rows, "left") if rows else Markup("")


def _could_see(pairs: Pairs, confidence: float) -> str:
    """The smallest gain that so many pairs show in four of five campaigns."""
    if not pairs.runs:
        return ""
    least = detectable_gain(pairs.runs, (pairs.only_first + pairs.only_second) / pairs.runs, confidence)
    return "; could have seen no difference" if least is None else f"; could have seen {100 * least:.0f} points"


def decision_table(decisions: Sequence[Decision]) -> Markup:
    """What the flights say of the requirements; empty without any."""
    rows: list[tuple[object, ...]] = [
        (
            one.requirement, one.scenario, one.policy, Markup("<b>{}</b>").format(one.outcome),
            f"{one.estimate:.3f} ({one.low:.3f} to {one.high:.3f})", one.runs, f"{one.p_met:.3g}", f"{one.p_not:.3g}",
        )
        for one in decisions
    ]  # fmt: skip
    head = ("requirement", "scenario", "policy", "outcome", "estimate", "flights", "p if not so", "p if so")
    return table(head, rows, "left") if rows else Markup("")


def _of(results: Mapping[Conditions, bool], scenario: str) -> dict[Conditions, bool]:
    return {key: value for key, value in results.items() if scenario in ("all", key[0])}
