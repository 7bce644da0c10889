"""Two ways a board may be driven, filtered side by side: an interacting multiple model (Blom and Bar-Shalom 1988).

One size of acceleration does not fit all: what follows the paper's Hard-I law (1.6 m/s^2) adds half to the errors of
speed on the published noise where the speed hardly changes; where measurements are good it costs nothing, and any delay
in following a board that brakes costs perches. Both models are the same motion with another acceleration; the
measurements say which holds, and how good they are whether there is a question.
"""

from __future__ import annotations

import math

from kernel.jit import njit
from policies.estimation.ctrv import CALM, CALM_NOISE, LIVELY, SETTLE, N, drive_sigma, wrap

MODELS = 2
MODEL_DIM = N + N * N  # state, then covariance (row-major)
_SURE = 0.95  # a calm board may always set off


@njit
def model_state(models, j):
    """State and covariance of model `j` in `models` (MODELS * MODEL_DIM,), as views."""
    at = j * MODEL_DIM
    return models[at : at + N], models[at + N : at + MODEL_DIM]


@njit
def combine(weights, models, x, p):
    """Mean (`x` (N,)) and covariance (`p` (N * N,)) of the mixture."""
    likeliest = 0
    for j in range(1, MODELS):
        likeliest = j if weights[j] > weights[likeliest] else likeliest
    first, _ = model_state(models, likeliest)
    x[:] = 0.0
    for j in range(MODELS):
        state, _ = model_state(models, j)
        for a in range(N):
            difference = wrap(state[a] - first[a]) if a == 3 else state[a] - first[a]
            x[a] += weights[j] * difference
    for a in range(N):
        x[a] += first[a]
    x[3] = wrap(x[3])
    p[:] = 0.0
    for j in range(MODELS):
        state, covariance = model_state(models, j)
        for a in range(N):
            da = wrap(state[a] - x[a]) if a == 3 else state[a] - x[a]
            for b in range(N):
                db = wrap(state[b] - x[b]) if b == 3 else state[b] - x[b]
                p[a * N + b] += weights[j] * (covariance[a * N + b] + da * db)


@njit
def expected(params, r, out):
    """Probability of each model before anything is known but the noise of positions (variances `r`), into `out`."""
    noise = math.sqrt(0.5 * (r[0] + r[1])) / params[CALM_NOISE]
    out[CALM] = _SURE * min(1.0, max(0.0, noise - 1.0))
    out[LIVELY] = 1.0 - out[CALM]


@njit
def mix(weights, models, dt, params, r, prior, mixed, scratch):
    """What each model starts from after `dt` s in which the way of driving may have changed.

    `r`: variances of what is measured then. `prior` (MODELS,) gets the models' probabilities before that, `mixed` their
    states; `scratch` (2 * MODELS,).
    """
    kept, share, usual = math.exp(-dt / params[SETTLE]), scratch[:MODELS], scratch[MODELS:]
    expected(params, r, usual)
    for j in range(MODELS):
        total = 0.0
        for i in range(MODELS):
            share[i] = weights[i] * ((1.0 - kept) * usual[j] + (kept if i == j else 0.0))
            total += share[i]
        prior[j] = total
        for i in range(MODELS):
            share[i] = share[i] / total if total > 0.0 else weights[i]
        x, p = model_state(mixed, j)
        combine(share, models, x, p)


@njit
def judge(prior, misfits, weights):
    """Probabilities after a measurement whose -2 log likelihood under each model is `misfits`, into `weights`."""
    least = math.inf
    for j in range(MODELS):
        least = min(least, misfits[j]) if prior[j] > 0.0 else least
    total = 0.0
    for j in range(MODELS):
        weights[j] = prior[j] * math.exp(-0.5 * (misfits[j] - least)) if prior[j] > 0.0 else 0.0
        total += weights[j]
    for j in range(MODELS):
        weights[j] /= total


@njit
def start_models(x, p, params, r, weights, models):
    """Every model from one state; how large the acceleration may be is each one's own."""
    expected(params, r, weights)
    for j in range(MODELS):
        state, covariance = model_state(models, j)
        state[:], covariance[:] = x, p
        covariance[7 * (N + 1)] = drive_sigma(params, float(j)) ** 2
