import math

import numpy as np
import pytest

from groundcar.motion import speed_laws as s
from groundcar.motion.speed_laws import speed_law, speed_nominal, speed_peak
from kernel.random import normal, stream


def test_hard_i_cosine_agrees_with_the_paper():
    row = s.cosine_speed()
    for t in np.linspace(0, 7, 29):
        expected = 1.0 + 1.5 * (1 + math.cos(2 * math.pi * t / 3)) / 2
        assert speed_nominal(s.COSINE, row, t) == pytest.approx(expected)
    assert speed_peak(s.COSINE, row) == 2.5
    assert speed_nominal(s.COSINE, s.cosine_speed(phase=math.pi), 0.0) == pytest.approx(1.0)


def test_schedule_ramps_once():
    row = s.scheduled_speed(2.2, 1.5, ramp=0.5, switch=3.0)
    got = [speed_nominal(s.SCHEDULED, row, t) for t in (0.0, 3.0, 3.25, 3.5, 9.0)]
    assert got == pytest.approx([2.2, 2.2, 1.85, 1.5, 1.5])
    assert speed_nominal(s.SCHEDULED, s.scheduled_speed(2.2, 1.5, ramp=0.0, switch=3.0), 3.01) == 1.5
    assert speed_nominal(s.SCHEDULED, s.scheduled_speed(2.2, 1.5), 1e6) == 2.2
    assert speed_peak(s.SCHEDULED, row) == 2.2


def test_ou_speed_follows_the_recursion_of_the_paper():
    row, state, rng, own = s.ou_speed(2.0), np.zeros(1), stream(4), stream(4)
    eta, beta = 0.0, 0.01 / 1.01
    for k in range(200):
        eta = (1 - beta) * eta + 0.1 * math.sqrt(beta) * normal(own)
        assert speed_law(s.OU, row, state, 0.01 * k, 0.01, rng) == pytest.approx(2.0 * math.exp(eta))


def test_ou_has_its_stationary_spread_and_correlation_time():
    row, state, rng = s.ou_speed(1.0), np.zeros(1), stream(9)
    eta = np.log([speed_law(s.OU, row, state, 0.0, 0.01, rng) for _ in range(300_000)])[1000:]
    beta = 0.01 / 1.01
    assert eta.std() == pytest.approx(0.1 * math.sqrt(beta / (1 - (1 - beta) ** 2)), rel=0.05)
    later = np.corrcoef(eta[:-100], eta[100:])[0, 1]
    assert later == pytest.approx((1 - beta) ** 100, abs=0.06)


def test_speed_laws_without_noise_do_not_advance_the_random_stream():
    rng, state = stream(3), np.zeros(1)
    for kind, row in ((s.CONSTANT, s.constant_speed(1.5)), (s.COSINE, s.cosine_speed())):
        speed_law(kind, row, state, 0.4, 0.01, rng)
    assert rng == stream(3)
    assert state[0] == 0.0


@pytest.mark.parametrize(
    "build",
    [
        lambda: s.constant_speed(-1.0),
        lambda: s.constant_speed(math.nan),
        lambda: s.ou_speed(1.0, tau=0.0),
        lambda: s.cosine_speed(2.0, 1.0),
        lambda: s.cosine_speed(period=0.0),
        lambda: s.scheduled_speed(2.0, 1.0, ramp=-0.1),
    ],
)
def test_invalid_arguments_are_refused(build):
    with pytest.raises(ValueError, match="speed law"):
        build()
