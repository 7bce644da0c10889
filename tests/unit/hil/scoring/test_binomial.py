import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.scoring.binomial import at_least, interval


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [  # published tables of exact 95 % limits
        (0, 10, 0.0, 0.3085),
        (10, 10, 0.6915, 1.0),
        (5, 10, 0.1871, 0.8129),
        (7, 10, 0.3475, 0.9333),
        (18, 20, 0.6830, 0.9877),
        (20, 20, 0.8316, 1.0),
    ],
)
def test_exact_interval_agrees_with_known_values(k, n, low, high):
    assert interval(k, n) == pytest.approx((low, high), abs=5e-5)


def test_limits_without_failures_have_a_closed_form():
    for n in (1, 7, 60, 1000):
        assert interval(n, n)[0] == pytest.approx(0.025 ** (1 / n), abs=1e-12)
        assert interval(0, n)[1] == pytest.approx(1 - 0.025 ** (1 / n), abs=1e-12)


@given(st.integers(1, 200), st.data())
def test_interval_tails_have_the_requested_probability(n, data):
    k = data.draw(st.integers(0, n))
    low, high = interval(k, n, 0.9)
    assert 0.0 <= low <= k / n <= high <= 1.0
    if k:
        assert at_least(k, n, low) == pytest.approx(0.05, rel=1e-9)
    if k < n:
        assert 1 - at_least(k + 1, n, high) == pytest.approx(0.05, rel=1e-9)


@given(st.integers(1, 60), st.floats(0, 1), st.data())
def test_tail_against_exact_sums(n, p, data):
    k = data.draw(st.integers(0, n))
    exact = math.fsum(math.comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(k, n + 1))
    assert at_least(k, n, p) == pytest.approx(exact, abs=1e-12)


def test_interval_coverage_is_at_least_nominal():
    rng = np.random.default_rng(1)
    for p in (0.1, 0.5, 0.93):
        draws = rng.binomial(20, p, 2000)
        table = [interval(k, 20) for k in range(21)]
        covered = np.mean([table[k][0] <= p <= table[k][1] for k in draws])
        assert covered >= 0.94


@pytest.mark.parametrize(("k", "n"), [(-1, 5), (6, 5), (0, 0)])
def test_impossible_counts_are_refused(k, n):
    with pytest.raises(ValueError, match="no count"):
        interval(k, n)
    with pytest.raises(ValueError, match="confidence"):
        interval(1, 2, 1.0)
