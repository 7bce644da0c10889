import numpy as np
import pytest

from vehicle.quadrotor.wind import Wind


def wind_samples(wind, seconds, period_ns=4_000_000):
    return np.array([wind.at(k * period_ns) for k in range(int(seconds * 1e9 / period_ns))])


def test_wind_without_gusts_is_its_mean():
    assert (wind_samples(Wind((1.0, -2.0, 0.0), 0.0, 1.0, 3), 0.1) == (1.0, -2.0, 0.0)).all()


def test_gusts_have_the_given_sigma_and_correlation_time():
    gusts = wind_samples(Wind((0.0, 0.0, 0.0), 2.0, 0.5, 7), 400.0, 20_000_000)
    assert gusts.std(axis=0) == pytest.approx((2.0, 2.0, 1.0), rel=0.12)
    x = gusts[:, 0] - gusts[:, 0].mean()
    after_half_a_second = (x[:-25] * x[25:]).mean() / (x * x).mean()
    assert after_half_a_second == pytest.approx(np.exp(-1.0), abs=0.1)


def test_equal_seeds_give_equal_winds():
    same = [wind_samples(Wind((0.0, 0.0, 0.0), 1.0, 1.0, seed), 1.0) for seed in (5, 5, 6)]
    assert (same[0] == same[1]).all()
    assert (same[0] != same[2]).any()


@pytest.mark.parametrize("bad", [(-1.0, 1.0), (1.0, 0.0), (float("nan"), 1.0)])
def test_invalid_wind_is_refused(bad):
    with pytest.raises(ValueError, match="wind needs"):
        Wind((0.0, 0.0, 0.0), *bad, 1)
