import math

from hypothesis import given
from hypothesis import strategies as st

from hil.scoring.comparison import Pairs, pair, words

COUNT = st.integers(0, 40)
PAIRS = st.builds(Pairs, COUNT, COUNT, COUNT, COUNT)
RESULTS = st.dictionaries(st.integers(0, 30), st.booleans())


def sign_test(pairs: Pairs) -> float:
    """Two-sided p of equal odds, from the definition."""
    n, k = pairs.only_first + pairs.only_second, min(pairs.only_first, pairs.only_second)
    return min(1.0, 2 * sum(math.comb(n, i) for i in range(k + 1)) / 2**n)


@given(PAIRS)
def test_comparison_verdict_agrees_with_an_exact_sign_test(pairs):
    found = pairs.verdict()
    decided = sign_test(pairs) < 0.05
    assert (found in ("better", "worse")) is decided
    if decided:
        assert (found == "better") is (pairs.gain > 0)


@given(PAIRS)
def test_gain_lies_in_its_interval_and_changes_sign_with_the_order_of_policies(pairs):
    low, high = pairs.gain_interval()
    assert -1.0 <= low <= pairs.gain + 1e-12 and pairs.gain - 1e-12 <= high <= 1.0
    other = Pairs(pairs.both, pairs.only_second, pairs.only_first, pairs.neither)
    assert other.gain == -pairs.gain
    assert math.isclose(other.gain_interval()[0], -high, abs_tol=1e-9)


@given(RESULTS, RESULTS)
def test_comparison_uses_only_common_conditions(first, second):
    pairs = pair(first, second)
    common = first.keys() & second.keys()
    assert pairs.runs == len(common)
    if common:
        rates = [sum(results[key] for key in common) / len(common) for results in (first, second)]
        assert math.isclose(pairs.gain, rates[1] - rates[0], abs_tol=1e-12)


def test_comparison_is_described_in_words():
    assert words(pair({}, {})) == "no common seed"
    assert words(Pairs(3, 0, 0, 2)) == "equal on every seed, 5 of them: +0 points (-52 to +52)"
    assert words(Pairs(0, 0, 6, 4)).startswith("better: +60 points (+5 to +60), of 10 seeds 6 gained, 0 lost")
    assert words(Pairs(0, 6, 0, 4)).startswith("worse: -60 points (-60 to -5)")
    assert words(Pairs(0, 0, 5, 5)).startswith("no difference shown: +50 points")
