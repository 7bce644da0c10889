"""The planner fed by the learned motion predictor: `planner_on_estimate` with a network."""

from __future__ import annotations

from kernel.jit import njit
from policies.estimation import belief_state
from policies.planner import estimate_row, state_row
from policies.planner import params_row as pp
from policies.planner.decide import planner_due
from policies.planner.planner import planner_step
from policies.planner.runup import runs_up
from policies.prediction import coast_row, net_row, oscillation_row, speeds_row
from policies.prediction.coast import coast_future, coast_keep, coast_state, coasting
from policies.prediction.future import carry_oscillation, predict_oscillation
from policies.prediction.learned import HISTORY_DIM as _COAST
from policies.prediction.learned import predict_learned, predictor_push
from policies.prediction.speed_history import HISTORY_DIM, fit_oscillation, history_push

MEMORY_DIM = _COAST + coast_row.DIM
_FRESH = 0.25  # s, age up to which a belief's speed enters the speed history


@njit
def planner_on_learned(state, memory, t, p, v, q, x, estimate, future, step, params, net, scratch, out):
    """`planner_on_estimate` with the learned predictor; returns the phase.

    Beyond its arguments: `memory` (MEMORY_DIM,), zeroed with the planner; `net` (net_row.DIM,) float32, empty for the
    analytic prediction alone; `scratch` (policies.prediction.scratch_row.DIM,) float32.
    """
    limits = params[pp.COUNT :] if runs_up(x, params) else params
    history, fit, coast = (
        state[state_row.HISTORY : state_row.HISTORY + HISTORY_DIM],
        state[state_row.FIT : state_row.FIT + oscillation_row.DIM],
        memory[_COAST:],
    )
    age, learned = estimate[estimate_row.AGE], net.shape[0] > 0
    if estimate[estimate_row.VALID] > 0.0:
        predictor_push(memory[:_COAST], t, x, age)
        if age < _FRESH:
            history_push(history, t, x[belief_state.SPEED])
    tau, due = limits[pp.prediction.acceleration_tau], planner_due(state, t)
    if due:
        fit_oscillation(history, tau, fit)
        estimate[estimate_row.SURPRISE] = fit[oscillation_row.SURPRISE]
    if learned and coasting(coast, t, age):
        coast_state(coast, t, step, x)
        if due:
            coast_future(coast, t, step, future)
    else:
        fit[oscillation_row.SINCE] = t - history[speeds_row.TIME]
        east, north, speed = x[belief_state.X], x[belief_state.Y], x[belief_state.SPEED]
        carry_oscillation(x, fit, age, limits[pp.prediction.filter_tau])
        if due:
            predict_oscillation(x, fit, tau, step, future)
            if learned:
                # The network was trained on the filter's own belief, and corrects that belief's lag by itself.
                carried_east, carried_north, carried = x[belief_state.X], x[belief_state.Y], x[belief_state.SPEED]
                x[belief_state.X], x[belief_state.Y], x[belief_state.SPEED] = east, north, speed
                sigma, speed_sigma = estimate[estimate_row.SIGMA], estimate[estimate_row.SPEED_SIGMA]
                trust, surprise = predict_learned(
                    memory[:_COAST], t, x, sigma, speed_sigma, age, estimate[estimate_row.STREAK], step, net, scratch,
                    limits[pp.prediction.trust], future,
                )  # fmt: skip
                estimate[estimate_row.SURPRISE] += (
                    net[net_row.DOUBT] * trust * (surprise - estimate[estimate_row.SURPRISE])
                )
                coast_keep(coast, t, age, future)
                x[belief_state.X], x[belief_state.Y], x[belief_state.SPEED] = carried_east, carried_north, carried
    return planner_step(state, t, p, v, q, x, estimate, future, step, params, out)
