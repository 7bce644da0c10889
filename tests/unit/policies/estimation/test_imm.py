"""The two motion models of the filter: the algebra of their mixture, and their probabilities."""

import numpy as np
import pytest

from policies.estimation import belief_row, belief_state
from policies.estimation import board_ekf as b
from policies.estimation.ctrv import CALM, LIVELY, BeliefParams
from policies.estimation.imm import combine, expected, judge, mix, model_state
from tests.unit.policies.estimation.test_board_ekf import run

PARAMS = BeliefParams()


def mixture(seed, heading=0.0):
    """(weights, models) of two random states near each other."""
    rng = np.random.default_rng(seed)
    models = np.zeros(belief_row.MODEL_COUNT * belief_row.MODEL_DIM)
    for j in range(belief_row.MODEL_COUNT):
        x, p = model_state(models, j)
        root = rng.normal(size=(belief_state.DIM, belief_state.DIM))
        x[:], p[:] = 0.1 * rng.normal(size=belief_state.DIM), (root @ root.T).ravel()
        x[3] = b.wrap(x[3] + heading)
    share = rng.uniform(0.1, 0.9)
    return np.array([share, 1.0 - share]), models


def moments(weights, models):
    states = models.reshape(belief_row.MODEL_COUNT, belief_row.MODEL_DIM)
    mean = weights @ states[:, : belief_state.DIM]
    apart = states[:, : belief_state.DIM] - mean
    return mean, sum(
        w * (s[belief_state.DIM :].reshape(belief_state.DIM, belief_state.DIM) + np.outer(d, d))
        for w, s, d in zip(weights, states, apart, strict=True)
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_mixture_has_the_moments_of_its_parts_and_mixing_keeps_them(seed):
    weights, models = mixture(seed)
    mean, covariance = moments(weights, models)
    x, p = np.zeros(belief_state.DIM), np.zeros(belief_state.DIM * belief_state.DIM)
    combine(weights, models, x, p)
    assert x == pytest.approx(mean)
    assert p.reshape(belief_state.DIM, belief_state.DIM) == pytest.approx(covariance)
    prior, mixed = np.zeros(belief_row.MODEL_COUNT), np.zeros_like(models)
    mix(weights, models, 0.3, PARAMS.row(), np.full(5, 1e-3), prior, mixed, np.zeros(2 * belief_row.MODEL_COUNT))
    assert prior.sum() == pytest.approx(1.0)
    combine(prior, mixed, x, p)
    assert x == pytest.approx(mean)
    assert p.reshape(belief_state.DIM, belief_state.DIM) == pytest.approx(covariance)


def test_mixture_of_headings_across_pi():
    weights, models = np.array([0.5, 0.5]), np.zeros(belief_row.MODEL_COUNT * belief_row.MODEL_DIM)
    models[3], models[belief_row.MODEL_DIM + 3] = np.pi - 0.02, -np.pi + 0.04
    x, p = np.zeros(belief_state.DIM), np.zeros(belief_state.DIM * belief_state.DIM)
    combine(weights, models, x, p)
    assert x[3] == pytest.approx(-np.pi + 0.01)
    assert p[3 * (belief_state.DIM + 1)] == pytest.approx(0.03**2)


def test_model_probabilities_return_to_the_prior_after_a_long_gap():
    weights, models = mixture(1)
    prior, mixed, usual = np.zeros(belief_row.MODEL_COUNT), np.zeros_like(models), np.zeros(belief_row.MODEL_COUNT)
    for sigma, calm in ((0.02, 0.0), (1.5 * PARAMS.calm_noise, 0.475), (0.2, 0.95)):
        r = np.full(5, sigma**2)
        expected(PARAMS.row(), r, usual)
        mix(weights, models, 60.0, PARAMS.row(), r, prior, mixed, np.zeros(2 * belief_row.MODEL_COUNT))
        assert usual == pytest.approx([calm, 1.0 - calm])
        assert prior == pytest.approx(usual)


def test_model_update_raises_the_likelier_model_and_keeps_zero_at_zero():
    weights = np.zeros(belief_row.MODEL_COUNT)
    judge(np.array([0.5, 0.5]), np.array([3.0, 9.0]), weights)
    assert weights[CALM] == pytest.approx(1.0 / (1.0 + np.exp(-3.0)))
    judge(np.array([0.0, 1.0]), np.array([3.0, 9000.0]), weights)
    assert weights.tolist() == [0.0, 1.0]


def test_precise_measurements_select_the_model_with_more_acceleration():
    ends = [
        run("cosine", 1, 0.01, 0.01, params=BeliefParams(calm_accel=accel))[0].row[belief_row.STATE : belief_row.TIME]
        for accel in (0.3, 1.5)
    ]
    assert np.array_equal(*ends)


def test_model_probabilities_follow_the_board_s_acceleration():
    def lively(kind):  # the cosine brakes hardest at 5.25 s
        return np.mean([run(kind, k, 0.05, 0.01, seconds=5.3)[0].row[belief_row.WEIGHTS + LIVELY] for k in range(6)])

    assert lively("cosine") > 1.2 * lively("ou")


def test_calm_model_reduces_speed_error_under_noise():
    def speed_error(params):
        ends = [run("ou", k, 0.1, 0.1, params=params) for k in range(30)]
        return float(np.sqrt(np.mean([(f.row[4] - truth[4]) ** 2 for f, *_, truth, _ in ends])))

    assert speed_error(PARAMS) < 0.75 * speed_error(BeliefParams(calm_accel=PARAMS.accel_sigma))
