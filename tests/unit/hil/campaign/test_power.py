"""How many flights a difference takes: against simulated campaigns."""

import itertools

import numpy as np
import pytest
from scipy.stats import binomtest

from hil.campaign.power import detectable, detectable_gain, flights_for, pair_power, single_power


def test_power_of_a_rate_agrees_with_simulated_campaigns():
    rng = np.random.default_rng(1)
    table = {k: binomtest(k, 150, 0.9, alternative="greater").pvalue <= 0.05 for k in range(151)}
    shown = np.mean([table[k] for k in rng.binomial(150, 0.95, 4000)])
    assert single_power(150, 0.9, 0.95, 0.95) == pytest.approx(shown, abs=0.03)


def test_power_of_a_pair_agrees_with_simulated_campaigns():
    rng = np.random.default_rng(2)
    outcomes = rng.multinomial(100, [0.15, 0.05, 0.8], 2000)
    shown = np.mean([a + b > 0 and a > b and binomtest(int(a), int(a + b), 0.5).pvalue <= 0.05 for a, b, _ in outcomes])
    assert pair_power(100, 0.10, 0.20, 0.95) == pytest.approx(shown, abs=0.04)


def test_fewest_flights_keep_the_power_and_one_less_does_not():
    def power(count):
        return single_power(count, 0.9, 0.95, 0.95)

    count = flights_for(power, 0.8)
    assert count is not None and power(count) >= 0.8 and 150 < count < 300
    assert any(power(count - 1 + more) < 0.8 for more in (0, 1, 2, 4, 8, 16))


def test_effect_that_is_too_small_has_no_number():
    assert flights_for(lambda count: 0.1, 0.8) is None


def test_smallest_difference_shrinks_with_the_flights():
    found = [detectable(n, 0.95) for n in (20, 80, 320)]
    assert all(a is not None and b is not None and a > b for a, b in itertools.pairwise(found))
    assert detectable(20, 1.0) == pytest.approx(1 - 0.2 ** (1 / 20))
    assert detectable(3, 0.5) is None


def test_smallest_gain_has_the_power_it_says():
    gain = detectable_gain(100, 0.1)
    assert gain is not None and pair_power(100, gain, 0.1, 0.95) == pytest.approx(0.8, abs=0.01)
    assert detectable_gain(4, 0.0) is None
