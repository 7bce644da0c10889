"""Two models of the board's acceleration, filtered side by side: an interacting multiple model (Blom, Bar-Shalom 1988).

One size of acceleration does not fit all motions. The size that follows the paper's Hard-I law (1.6 m/s^2) raises the
speed error by half under the paper's noise where the speed hardly changes. With precise measurements it costs nothing,
and a delay in following a board that brakes costs perches. Both models are the same motion with another acceleration;
the measurements decide which one holds.
"""

from __future__ import annotations

import math

from kernel.clip import clip
from kernel.jit import njit
from policies.estimation import belief_row, belief_state, filter_row, measured_row
from policies.estimation.ctrv import CALM, LIVELY, drive_sigma, wrap

_SURE = 0.95  # most prior probability of the calm model: a calm board may accelerate at any time


@njit
def model_state(models, j):
    """State and covariance of model `j` in `models` (MODELS * MODEL_DIM,), as views."""
    at = j * belief_row.MODEL_DIM
    return models[at : at + belief_state.DIM], models[at + belief_state.DIM : at + belief_row.MODEL_DIM]


@njit
def combine(weights, models, x, p):
    """Mean (`x` (N,)) and covariance (`p` (N * N,)) of the mixture."""
    likeliest = 0
    for j in range(1, belief_row.MODEL_COUNT):
        likeliest = j if weights[j] > weights[likeliest] else likeliest
    first, _ = model_state(models, likeliest)
    x[:] = 0.0
    for j in range(belief_row.MODEL_COUNT):
        state, _ = model_state(models, j)
        for a in range(belief_state.DIM):
            difference = wrap(state[a] - first[a]) if a == belief_state.HEADING else state[a] - first[a]
            x[a] += weights[j] * difference
    for a in range(belief_state.DIM):
        x[a] += first[a]
    x[belief_state.HEADING] = wrap(x[belief_state.HEADING])
    p[:] = 0.0
    for j in range(belief_row.MODEL_COUNT):
        state, covariance = model_state(models, j)
        turned = wrap(state[belief_state.HEADING] - x[belief_state.HEADING])
        for a in range(belief_state.DIM):
            da = turned if a == belief_state.HEADING else state[a] - x[a]
            for b in range(belief_state.DIM):
                db = turned if b == belief_state.HEADING else state[b] - x[b]
                p[a * belief_state.DIM + b] += weights[j] * (covariance[a * belief_state.DIM + b] + da * db)


@njit
def expected(params, r, out):
    """Prior probability of each model, given the measurement's variances `r` alone, into `out`."""
    noise = math.sqrt(0.5 * (r[measured_row.X] + r[measured_row.Y])) / params[filter_row.CALM_NOISE]
    out[CALM] = _SURE * clip(noise - 1.0, 0.0, 1.0)
    out[LIVELY] = 1.0 - out[CALM]


@njit
def mix(weights, models, dt, params, r, prior, mixed, scratch):
    """Interaction step: what each model starts from after `dt` s in which the model may have changed.

    `r`: variances of the measurement then. `prior` (MODELS,) gets the models' probabilities before that, `mixed` their
    states; `scratch` (2 * MODELS,).
    """
    kept, share, usual = (
        math.exp(-dt / params[filter_row.SETTLE]),
        scratch[: belief_row.MODEL_COUNT],
        scratch[belief_row.MODEL_COUNT :],
    )
    expected(params, r, usual)
    for j in range(belief_row.MODEL_COUNT):
        total = 0.0
        for i in range(belief_row.MODEL_COUNT):
            share[i] = weights[i] * ((1.0 - kept) * usual[j] + (kept if i == j else 0.0))
            total += share[i]
        prior[j] = total
        for i in range(belief_row.MODEL_COUNT):
            share[i] = share[i] / total if total > 0.0 else weights[i]
        x, p = model_state(mixed, j)
        combine(share, models, x, p)


@njit
def judge(prior, misfits, weights):
    """Probabilities after a measurement whose -2 log likelihood under each model is `misfits`, into `weights`."""
    least = math.inf
    for j in range(belief_row.MODEL_COUNT):
        least = min(least, misfits[j]) if prior[j] > 0.0 else least
    total = 0.0
    for j in range(belief_row.MODEL_COUNT):
        weights[j] = prior[j] * math.exp(-0.5 * (misfits[j] - least)) if prior[j] > 0.0 else 0.0
        total += weights[j]
    for j in range(belief_row.MODEL_COUNT):
        weights[j] /= total


@njit
def start_models(x, p, params, r, weights, models):
    """Start every model from one state; each has its own variance of the acceleration."""
    expected(params, r, weights)
    for j in range(belief_row.MODEL_COUNT):
        state, covariance = model_state(models, j)
        state[:], covariance[:] = x, p
        covariance[belief_state.ACCELERATION * (belief_state.DIM + 1)] = drive_sigma(params, float(j)) ** 2
