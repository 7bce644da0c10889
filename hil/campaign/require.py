"""Requirements on a campaign, and what its flights say of them: met, not met, or undecided at this number of flights.

Each scenario and policy is tested by itself, with exact tests of scipy; over all of them the p values are corrected for
multiplicity (Holm 1979).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from scipy.stats import binomtest, fisher_exact

from hil.campaign.lines import Line
from hil.recording.manifest import nested
from hil.scoring.binomial import interval
from hil.scoring.comparison import Pairs, pair
from hil.scoring.flight_class import UNSAFE
from hil.scoring.verdict import PERCHED
from kernel.toml_errors import nearest

MET, NOT_MET, UNDECIDED = "met", "not met", "undecided"
RATES = ("within_tolerance", "attached", "perched", "safe")
_RATE = re.compile(r"^\s*(\w+)\s*(>=|>|<=|<)\s*(\d*\.?\d+)\s*$")
_WORSE = re.compile(r"^\s*not worse by\s+(\d*\.?\d+)\s*$")


@dataclass(frozen=True)
class Requirement:
    """`text` as written. `rate` with `operator` and `limit`; or of a pair: "better", or "not worse" by `limit`."""

    text: str
    rate: str
    operator: str
    limit: float

    @property
    def of_pairs(self) -> bool:
        """Whether it compares a policy with the first one."""
        return self.rate in ("better", "not worse")


@dataclass(frozen=True)
class Decision:
    """What the flights of one scenario and policy say of one requirement. `p_met` and `p_not`: of the two one-sided
    tests, corrected."""

    requirement: str
    scenario: str
    policy: str
    successes: int
    runs: int
    estimate: float
    low: float
    high: float
    p_met: float
    p_not: float
    outcome: str


def read(text: str) -> Requirement:
    """A requirement as a user writes it. Raises ValueError naming what is allowed."""
    if text.strip() == "better":
        return Requirement(text.strip(), "better", ">", 0.0)
    worse = _WORSE.match(text)
    if worse:
        return Requirement(text.strip(), "not worse", ">", _share(text, float(worse[1])))
    found = _RATE.match(text)
    if found is None:
        raise ValueError(
            f"--require {text!r}: write for example 'within_tolerance >= 0.9', 'better' or 'not worse by 0.02'"
        )
    if found[1] not in RATES:
        raise ValueError(f'--require: there is no "{found[1]}"{nearest(found[1], RATES)} Allowed: {", ".join(RATES)}')
    return Requirement(text.strip(), found[1], found[2], _share(text, float(found[3])))


def _share(text: str, value: float) -> float:
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"--require {text!r}: {value:g} is no share between 0 and 1")
    return value


def decide(
    lines: Sequence[Line], requirements: Sequence[Requirement], baseline: str, confidence: float
) -> list[Decision]:
    """A decision for each requirement, scenario and policy. `baseline`: the policy that the others are compared with.

    A rate is required of every policy but the baseline, if there are others. Raises ValueError if there is nothing to
    decide on.
    """
    groups: dict[tuple[str, str], list[Line]] = {}
    for line in lines:
        about = line.group
        name = about.scenario + (f", {about.fault}" if about.fault else "")
        groups.setdefault((f"{name} ({about.identity}, {about.camera})", about.policy), []).append(line)
    policies = sorted({policy for _, policy in groups}, key=lambda name: (name.split(" ")[0] != baseline, name))
    tested = policies[1:] or policies
    found: list[tuple[Decision, Requirement]] = []
    for requirement in requirements:
        if requirement.of_pairs and len(policies) < 2:
            raise ValueError(f'--require "{requirement.text}" compares policies, and there is one: give --policy twice')
        for (scenario, policy), mine in sorted(groups.items()):
            if policy in tested and requirement.of_pairs:
                first = groups.get((scenario, policies[0]), [])
                found.append((_pairs(requirement, scenario, policy, first, mine, confidence), requirement))
            elif policy in tested:
                found.append((_rate(requirement, scenario, policy, mine, confidence), requirement))
    if not found:
        raise ValueError("--require: no flight has a verdict to decide on")
    met, against = holm([one.p_met for one, _ in found]), holm([one.p_not for one, _ in found])
    return [_decided(one, p_met, p_not, confidence) for (one, _), p_met, p_not in zip(found, met, against, strict=True)]


def overall(decisions: Sequence[Decision]) -> str:
    """Not met if one is not met; else undecided if one is; else met."""
    outcomes = {decision.outcome for decision in decisions}
    return next((word for word in (NOT_MET, UNDECIDED) if word in outcomes), MET)


def holm(values: Sequence[float]) -> list[float]:
    """The p values corrected for their number (Holm 1979)."""
    ranked, corrected, before = sorted(range(len(values)), key=lambda i: values[i]), [0.0] * len(values), 0.0
    for rank, place in enumerate(ranked):
        before = max(before, min(1.0, (len(values) - rank) * values[place]))
        corrected[place] = before
    return corrected


def _decided(one: Decision, p_met: float, p_not: float, confidence: float) -> Decision:
    level = 1.0 - confidence
    outcome = MET if p_met <= level else NOT_MET if p_not <= level else UNDECIDED
    facts = {**one.__dict__, "p_met": p_met, "p_not": p_not, "outcome": outcome}
    return Decision(**facts)


def _rate(requirement: Requirement, scenario: str, policy: str, lines: list[Line], confidence: float) -> Decision:
    known = [value for line in lines if (value := _value(line, requirement.rate)) is not None]
    if not known:
        raise ValueError(f'--require "{requirement.text}": no flight of {policy} on {scenario} says it')
    k, n = sum(known), len(known)
    above = binomtest(k, n, requirement.limit, alternative="greater").pvalue
    below = binomtest(k, n, requirement.limit, alternative="less").pvalue
    p_met, p_not = (above, below) if requirement.operator in (">", ">=") else (below, above)
    low, high = interval(k, n, confidence)
    return Decision(requirement.text, scenario, policy, k, n, k / n, low, high, float(p_met), float(p_not), UNDECIDED)


def _value(line: Line, rate: str) -> bool | None:
    if rate == "perched":
        return line.verdict == PERCHED
    if rate == "safe":
        flight = nested(line.score, "flight").get("class")
        return None if flight is None else flight != UNSAFE
    return bool(line.score[rate])


def _pairs(
    requirement: Requirement, scenario: str, policy: str, first: list[Line], second: list[Line], confidence: float
) -> Decision:
    if second[0].group.identity != "sim":
        return _independent(requirement, scenario, policy, first, second, confidence)
    pairs = pair(_by_seed(first), _by_seed(second))
    differ = pairs.only_first + pairs.only_second
    if not pairs.runs:
        raise ValueError(f'--require "{requirement.text}": the policies have no common seed on {scenario}')
    if requirement.rate == "better":
        p_met = binomtest(pairs.only_second, differ, 0.5, alternative="greater").pvalue if differ else 1.0
        p_not = binomtest(pairs.only_second, differ, 0.5, alternative="less").pvalue if differ else 1.0
    else:
        p_met = p_above(pairs, -requirement.limit)
        p_not = p_above(Pairs(pairs.both, pairs.only_second, pairs.only_first, pairs.neither), requirement.limit)
    low, high = pairs.gain_interval(confidence)
    return Decision(
        requirement.text, scenario, policy, pairs.only_second, pairs.runs, pairs.gain, low, high, float(p_met),
        float(p_not), UNDECIDED,
    )  # fmt: skip


def _by_seed(lines: Sequence[Line]) -> dict[Any, bool]:
    return {line.manifest.get("seed"): bool(line.score["within_tolerance"]) for line in lines}


def _independent(
    requirement: Requirement, scenario: str, policy: str, first: list[Line], second: list[Line], confidence: float
) -> Decision:
    """Real flights have no seeds in common: two rates, by Fisher's exact test or their two exact intervals."""
    if not first:
        raise ValueError(f'--require "{requirement.text}": the first policy has no flight on {scenario}')
    (a, m), (b, n) = ((sum(line.score["within_tolerance"] for line in some), len(some)) for some in (first, second))
    table = [[b, n - b], [a, m - a]]
    if requirement.rate == "better":
        results: list[Any] = [fisher_exact(table, alternative=side) for side in ("greater", "less")]
        p_met, p_not = (result.pvalue for result in results)
    else:
        p_met, p_not = p_rates(b, n, a, m, -requirement.limit), p_rates(a, m, b, n, requirement.limit)
    half = 1.0 - (1.0 - confidence) / 2
    (low_a, high_a), (low_b, high_b) = interval(a, m, half), interval(b, n, half)
    return Decision(
        requirement.text, scenario, policy, b, n, b / n - a / m, low_b - high_a, high_b - low_a, float(p_met),
        float(p_not), UNDECIDED,
    )  # fmt: skip


def p_rates(won: int, of: int, lost: int, of_lost: int, limit: float) -> float:
    """The smallest error at which the rate `won` of `of` less `lost` of `of_lost` is shown to be above `limit`."""
    return _least_error(lambda e: interval(won, of, 1.0 - e)[0] - interval(lost, of_lost, 1.0 - e)[1], limit)


def gain_bound(pairs: Pairs, level: float) -> float:
    """A lower bound of the gain with error `level`: that of what was won less that of what was lost, each exact with
    half the error (Bonferroni). It also holds where few pairs differ."""
    won = interval(pairs.only_second, pairs.runs, 1.0 - level)[0]
    lost = interval(pairs.only_first, pairs.runs, 1.0 - level)[1]
    return won - lost


def p_above(pairs: Pairs, limit: float) -> float:
    """The smallest error at which the gain is shown to be above `limit`."""
    return _least_error(lambda error: gain_bound(pairs, error), limit)


def _least_error(bound: Callable[[float], float], limit: float) -> float:
    """The smallest error at which the lower bound `bound(error)`, which rises with it, is above `limit`."""
    low, high = 1e-12, 1.0 - 1e-9
    if bound(high) <= limit:
        return 1.0
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (low, middle) if bound(middle) > limit else (middle, high)
    return high


def as_rows(decisions: Sequence[Decision]) -> list[dict[str, Any]]:
    """For JSON."""
    return [dict(decision.__dict__) for decision in decisions]
