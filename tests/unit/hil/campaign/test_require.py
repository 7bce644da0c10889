"""Requirements: what is read, when they are met, not met or undecided, and the correction for their number."""

import math
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.campaign.junit import junit
from hil.campaign.lines import Line
from hil.campaign.require import MET, NOT_MET, UNDECIDED, decide, gain_bound, holm, overall, p_above, read
from hil.scoring.comparison import Pairs


def line(seed, within, policy="planner", scenario="simple-i", identity="sim"):
    manifest = {
        "seed": seed, "identity": identity, "policy": {"name": policy}, "scenario": {"name": scenario},
        "rig": {"camera": {"source": "model"}},
    }  # fmt: skip
    score = {"within_tolerance": within, "attached": within, "outcome": "success" if within else "fail"}
    return Line(f"{policy}-{scenario}-{seed}", manifest, score)


def flights(successes, runs, **about):
    return [line(seed, seed < successes, **about) for seed in range(runs)]


def outcome(lines, *texts, confidence=0.95):
    return overall(decide(lines, [read(text) for text in texts], "planner", confidence))


@pytest.mark.parametrize(
    ("successes", "runs", "expected"),
    [(60, 60, MET), (20, 20, UNDECIDED), (20, 40, NOT_MET), (54, 60, UNDECIDED)],
)
def test_rate_is_decided_by_an_exact_test(successes, runs, expected):
    assert outcome(flights(successes, runs), "within_tolerance >= 0.9") == expected


def test_upper_limit_of_a_rate():
    assert outcome(flights(0, 60), "attached <= 0.1") == MET
    assert outcome(flights(30, 60), "attached < 0.1") == NOT_MET


def test_confidence_decides_how_many_flights_it_takes():
    assert outcome(flights(29, 29), "perched >= 0.9") == MET
    assert outcome(flights(29, 29), "perched >= 0.9", confidence=0.99) == UNDECIDED


def test_more_scenarios_make_each_harder():
    one = flights(29, 29)
    two = one + flights(29, 29, scenario="hard-i")
    assert outcome(one, "perched >= 0.9") == MET
    assert outcome(two, "perched >= 0.9") == UNDECIDED


def test_better_is_a_sign_test_on_common_seeds():
    first, second = flights(4, 20), flights(16, 20, policy="mine")
    assert outcome(first + second, "better") == MET
    assert outcome(flights(16, 20) + flights(4, 20, policy="mine"), "better") == NOT_MET
    assert outcome(first + flights(4, 20, policy="mine"), "better") == UNDECIDED


def test_not_worse_by_a_margin_needs_flights_even_if_nothing_differs():
    def equal(runs):
        return flights(runs, runs) + flights(runs, runs, policy="mine")

    assert outcome(equal(20), "not worse by 0.02") == UNDECIDED
    assert outcome(equal(300), "not worse by 0.02") == MET
    assert outcome(flights(300, 300) + flights(200, 300, policy="mine"), "not worse by 0.02") == NOT_MET


def test_real_flights_are_compared_without_pairs():
    first = flights(1, 12, identity="real")
    assert outcome(first + flights(11, 12, policy="mine", identity="real"), "better") == MET
    assert outcome(first + flights(2, 12, policy="mine", identity="real"), "better") == UNDECIDED


def test_rate_is_required_of_the_policies_that_are_compared_not_of_the_first():
    lines = flights(0, 60) + flights(60, 60, policy="mine")
    assert outcome(lines, "within_tolerance >= 0.9") == MET


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("within_tolerence >= 0.9", 'there is no "within_tolerence"; did you mean "within_tolerance"\\?'),
        ("within_tolerance >= 90", "no share between 0 and 1"),
        ("within_tolerance is good", "write for example"),
        ("not worse by 2", "no share"),
        ("", "write for example"),
    ],
)
def test_requirement_that_cannot_be_meant_is_refused(text, message):
    with pytest.raises(ValueError, match=message):
        read(text)


def test_requirement_without_flights_to_decide_it_is_refused():
    with pytest.raises(ValueError, match="give --policy twice"):
        decide(flights(1, 2), [read("better")], "planner", 0.95)
    with pytest.raises(ValueError, match=r"no flight of planner on simple-i .* says it"):
        decide(flights(1, 2), [read("safe >= 0.9")], "planner", 0.95)
    with pytest.raises(ValueError, match="no flight has a verdict"):
        decide([], [read("perched >= 0.9")], "planner", 0.95)


def test_holm_agrees_with_a_published_example():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


@given(st.lists(st.floats(0, 1), max_size=12))
def test_holm_never_lowers_a_p_value_and_keeps_their_order(values):
    corrected = holm(values)
    assert all(p <= q <= 1.0 for p, q in zip(values, corrected, strict=True))
    pairs = sorted(zip(values, corrected, strict=True))
    assert [q for _, q in pairs] == sorted(q for _, q in pairs)


@given(st.builds(Pairs, *[st.integers(0, 30)] * 4).filter(lambda pairs: pairs.runs > 0), st.floats(-0.5, 0.5))
def test_p_value_of_a_gain_belongs_to_its_bound(pairs, limit):
    p = p_above(pairs, limit)
    if p < 0.999:
        assert gain_bound(pairs, min(0.999, p * 1.01 + 1e-9)) > limit
    if 1e-9 < p < 0.999:
        assert gain_bound(pairs, p * 0.99) <= limit + 1e-6


def test_junit_says_what_is_undecided():
    decisions = decide(flights(20, 20), [read("within_tolerance >= 0.9")], "planner", 0.95)
    top = ET.fromstring(junit("mine", decisions))
    assert (top.get("tests"), top.get("errors"), top.get("failures")) == ("1", "1", "0")
    case = top.find(".//testcase")
    assert case is not None and case.find("error") is not None
    assert math.isfinite(decisions[0].p_met)
