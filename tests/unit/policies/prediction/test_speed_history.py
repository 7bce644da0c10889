import math

import numpy as np
import pytest

from kernel.random import normal, stream
from policies.prediction import oscillation_row, speeds_row
from policies.prediction import speed_history as sh


def filled(law, seconds, noise=0.0, seed=1):
    history, rng = np.zeros(sh.HISTORY_DIM), stream(seed)
    for k in range(int(seconds * 100)):
        sh.history_push(history, 0.01 * k, law(0.01 * k) + noise * normal(rng))
    return history


def oscillating_speed(t):
    return 1.0 + 0.75 * (1 + math.cos(2 * math.pi * t / 3.0 + 0.7))


def test_entries_are_a_sample_apart_and_a_gap_clears():
    history = filled(lambda t: t, 2.0)
    assert history[speeds_row.COUNT] == 40
    sh.history_push(history, 2.2, 1.0)
    assert history[speeds_row.COUNT] == 45 and history[speeds_row.TIME] == pytest.approx(2.2)
    sh.history_push(history, 3.6, 1.0)
    assert history[speeds_row.COUNT] == 1
    assert filled(lambda t: t, 9.0)[speeds_row.COUNT] == sh.LENGTH


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_oscillating_speed_is_predicted_after_one_period(noise):
    fit = np.zeros(oscillation_row.DIM)
    for seed in range(4):
        seconds = 4.5
        sh.fit_oscillation(filled(oscillating_speed, seconds, noise, seed), 0.8, fit)
        assert fit[3] > 0.7 and fit[4] < 0.15
        now = seconds - 0.05
        for ahead in (0.5, 1.0, 1.5):
            gained = sh.oscillation_gain(fit, ahead)
            assert gained == pytest.approx(
                oscillating_speed(now + ahead) - oscillating_speed(now), abs=0.12 + 4 * noise
            )


def test_oscillation_fit_has_no_trust_in_constant_and_random_speeds():
    fit, rng = np.zeros(oscillation_row.DIM), stream(5)
    sh.fit_oscillation(filled(lambda t: 2.0, 5.0, 0.03), 0.8, fit)
    assert abs(fit[3] * sh.oscillation_gain(fit, 1.0)) < 0.1 and fit[4] < 0.1
    worst = []
    for seed in range(12):
        eta, speeds, rng = 0.0, [], stream(seed, 9)
        for _ in range(700):
            eta = 0.99 * eta + 0.1 * math.sqrt(0.0099) * normal(rng)
            speeds.append(2.0 * math.exp(eta))
        history = filled(lambda t, s=speeds: s[round(100 * t)], 5.0)
        sh.fit_oscillation(history, 0.8, fit)
        foretold = speeds[499] + fit[3] * sh.oscillation_gain(fit, 1.0)
        worst.append(abs(foretold - speeds[599]) - abs(speeds[499] - speeds[599]))
    assert np.mean(worst) < 0.05  # over one second no worse than holding the speed


def test_oscillation_fit_has_no_trust_in_a_short_history():
    fit = np.zeros(oscillation_row.DIM)
    sh.fit_oscillation(filled(oscillating_speed, 0.6), 0.8, fit)
    assert fit[3] == 0.0 and fit[4] == sh.UNKNOWN


def test_range_of_speeds_excludes_the_first_entries():
    history = filled(lambda t: 3.0 if t < 0.3 else 1.0 + 0.2 * t, 2.0)
    least, most = sh.history_range(history)
    assert least == pytest.approx(1.08, abs=0.02) and most == pytest.approx(1.4, abs=0.02)
    assert sh.history_range(np.zeros(sh.HISTORY_DIM)) == (math.inf, 0.0)
