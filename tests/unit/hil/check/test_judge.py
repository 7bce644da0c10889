import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.check.judge import Limits, Outcome, Reading, judge

BOTH = Limits(min=1, marginal_min=2, marginal_max=8, max=9)


@pytest.mark.parametrize(
    ("value", "outcome", "margin"),
    [
        (0.5, Outcome.FAIL, -0.5),
        (1.0, Outcome.MARGINAL, 0.0),
        (1.5, Outcome.MARGINAL, 0.5),
        (2.0, Outcome.PASS, 1.0),
        (8.0, Outcome.PASS, 1.0),
        (8.5, Outcome.MARGINAL, 0.5),
        (9.5, Outcome.FAIL, -0.5),
        (5, Outcome.PASS, 4.0),
    ],
)
def test_limits_are_inclusive_and_the_margin_is_to_the_nearest_hard_one(value, outcome, margin):
    judged = judge(Reading(value), BOTH, "s")
    assert (judged.outcome, judged.margin) == (outcome, pytest.approx(margin))
    assert bool(judged.reason) == (outcome is not Outcome.PASS)


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_a_negative_margin_is_exactly_a_failure(value):
    judged = judge(Reading(value), BOTH)
    assert judged.margin is not None
    assert (judged.outcome is Outcome.FAIL) == (judged.margin < 0) == (not 1 <= value <= 9)


def test_a_declared_measurement_left_unset_fails():
    judged = judge(Reading(None, ok=True), Limits(max=1))
    assert judged.outcome is Outcome.FAIL
    assert "no value was measured" in judged.reason


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_non_finite_number_is_unknown(value):
    assert judge(Reading(value), BOTH).outcome is Outcome.UNKNOWN


def test_item_without_measurement_and_declared_value_is_unknown():
    assert judge(Reading(None, "cable?"), Limits()).reason == "cable?"
    assert judge(Reading(None), Limits()).outcome is Outcome.UNKNOWN


def test_verdict_of_the_check_overrides_the_limits():
    judged = judge(Reading(5, "but wrong", ok=False), BOTH)
    assert (judged.outcome, judged.reason) == (Outcome.FAIL, "but wrong")


@pytest.mark.parametrize(
    ("value", "wanted", "same"),
    [("can", "can", True), ("rc", "can", False), (0.3, 0.30000001192, True), (True, 1, False), (1, True, False)],
)
def test_equals_distinguishes_texts_numbers_and_booleans(value, wanted, same):
    assert (judge(Reading(value), Limits(equals=wanted)).outcome is Outcome.PASS) == same


@pytest.mark.parametrize("value", ["5", True])
def test_text_reading_fails_number_limits(value):
    assert judge(Reading(value), BOTH).outcome is Outcome.FAIL


@pytest.mark.parametrize(
    "limits",
    [{"min": 2, "max": 1}, {"min": 2, "marginal_min": 1}, {"max": 1, "marginal_max": 2}, {"equals": 1, "min": 0}],
)
def test_limits_that_contradict_each_other_are_refused(limits):
    with pytest.raises(ValueError, match=r"limits must rise|exclude"):
        Limits(**limits)


def test_limits_are_written_as_text():
    assert BOTH.text("s") == "1 to 9 s"
    assert Limits(max=5).text() == "at most 5"
    assert Limits(marginal_min=3).text("%") == "at least 3 %"
    assert Limits(equals="can").text() == "can"
    assert Limits().text("s") == ""
