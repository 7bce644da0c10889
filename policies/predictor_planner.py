"""The planner fed by the learned motion predictor: `planner_on_estimate` and `planner_on_belief`, with a network."""

from __future__ import annotations

from kernel import njit
from policies import planner_params as pp
from policies.planner import (
    E_AGE,
    E_SIGMA,
    E_SPEED_SIGMA,
    E_STREAK,
    E_SURPRISE,
    E_VALID,
    S_FIT,
    S_HISTORY,
    estimate_from_belief,
    planner_due,
    planner_step,
)
from policies.prediction import predict_swing
from policies.predictor import G_DOUBT, predict_learned, predictor_push
from policies.speed_history import FIT_DIM, HISTORY_DIM, fit_swing, history_push


@njit
def planner_on_learned(state, memory, t, p, v, q, x, estimate, future, step, params, net, scratch, out):
    """`planner.planner_on_estimate` with the learned predictor; returns the phase.

    Beyond its arguments: `memory` (predictor.HISTORY_DIM,), cleared with the planner; `net` (predictor.NET_DIM,)
    float32, empty: the analytic prediction alone; `scratch` (predictor.SCRATCH_DIM,) float32.
    """
    limits = params[pp.COUNT :] if x[6] >= params[pp.RUN_INCLINATION] else params
    if estimate[E_VALID] > 0.0:
        predictor_push(memory, t, x, estimate[E_AGE])
        if estimate[E_AGE] < 0.25:
            history_push(state[S_HISTORY : S_HISTORY + HISTORY_DIM], t, x[4])
    if planner_due(state, t):
        fit = state[S_FIT : S_FIT + FIT_DIM]
        tau = limits[pp.PREDICT_TAU]
        fit_swing(state[S_HISTORY : S_HISTORY + HISTORY_DIM], tau, fit)
        estimate[E_SURPRISE] = fit[4]
        predict_swing(x, fit, tau, step, future)
        if net.shape[0] > 0:
            trust, surprise = predict_learned(
                memory, t, x, estimate[E_SIGMA], estimate[E_SPEED_SIGMA], estimate[E_AGE], estimate[E_STREAK], step,
                net, scratch, future,
            )  # fmt: skip
            estimate[E_SURPRISE] += net[G_DOUBT] * trust * (surprise - estimate[E_SURPRISE])
    return planner_step(state, t, p, v, q, x, estimate, future, step, params, out)


@njit
def learned_on_belief(
    state, memory, t, p, v, q, belief, belief_params, x, covariance, estimate, future, step, params, net, scratch, out
):
    """`planner_on_learned` on a belief row; `x` (8,), `covariance` (64,), `estimate` hold the estimate afterwards."""
    estimate_from_belief(belief, t, belief_params, x, covariance, estimate)
    return planner_on_learned(state, memory, t, p, v, q, x, estimate, future, step, params, net, scratch, out)
