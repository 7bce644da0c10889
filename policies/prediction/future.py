"""Prediction of the board: `future` (K, 8), board rows at a fixed step from now, the planner's only input about motion.

Such an array is filled by the belief's own model below, by a learned predictor, or from the true motion (a teacher with
privileged information).
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.jit import njit
from policies.estimation import belief_state
from policies.estimation.ctrv import advance_state
from policies.prediction import oscillation_row
from policies.prediction.speed_history import oscillation_gain

HORIZON, STEP = 64, 0.05  # rows and seconds of the planner's future: 3.15 s


@njit
def predict_future(state, tau, step, out):
    """Fill `out` ((K, 8)); row 0 is now.

    `state` (8,): the belief's state now (policies.estimation.belief_state); `tau` s in which the acceleration decays;
    `step` s between rows. The motion is `policies.estimation.ctrv.advance_state`.
    """
    x = out[out.shape[0] - 1]  # the last row is filled last, so it may serve as the running state
    x[:] = state
    for k in range(out.shape[0] - 1):
        out[k, : board_row.U] = x[: board_row.U]
        out[k, board_row.U] = 0.0
        advance_state(x, step, tau)
    x[belief_state.ACCELERATION] = 0.0


@njit
def carry_oscillation(state, fit, age, tau):
    """Correct a believed `state` ((8,), in place) that was carried over `age` s without a measurement.

    The filter lets the acceleration decay in `tau` s; where the `fit` of speed_history is trusted the speed kept
    oscillating.
    """
    if fit[oscillation_row.TRUST] <= 0.0 or age <= 0.0:
        return
    keep = math.exp(-age / tau)
    gained = state[belief_state.ACCELERATION] / keep * tau * (1.0 - keep)
    # Metres and m/s of the oscillation over the gap (Simpson's rule), against those of the filter's own acceleration.
    back, middle = oscillation_gain(fit, -age), oscillation_gain(fit, -0.5 * age)
    changed = -back
    changed_far = age * (4.0 * (middle - back) + (0.0 - back)) / 6.0
    gained_far = state[belief_state.ACCELERATION] / keep * tau * age - gained * tau
    faster, farther = (
        fit[oscillation_row.TRUST] * (changed - gained),
        fit[oscillation_row.TRUST] * (changed_far - gained_far),
    )
    state[belief_state.X] += farther * math.cos(state[belief_state.HEADING])
    state[belief_state.Y] += farther * math.sin(state[belief_state.HEADING])
    state[belief_state.SPEED] += faster


@njit
def predict_oscillation(state, fit, tau, step, out):
    """Fill `out` ((K, 8)) like `predict_future`, with an oscillating speed as far as `fit` is trusted.

    `fit` (policies.prediction.oscillation_row.DIM,); the other arguments as of `predict_future`.
    The path's curvature is kept rather than the turn rate: a car that slows down in a bend turns more slowly.
    """
    trust, speed0 = fit[oscillation_row.TRUST], state[belief_state.SPEED]
    x = out[out.shape[0] - 1]
    x[:] = state
    bend = state[belief_state.TURN_RATE] / speed0 if abs(speed0) > 0.5 else 0.0
    speed = speed0
    for k in range(out.shape[0] - 1):
        out[k, : board_row.U] = x[: board_row.U]
        out[k, board_row.U] = 0.0
        before = speed
        ahead = (k + 1) * step
        singer = speed0 + state[belief_state.ACCELERATION] * tau * (1.0 - math.exp(-ahead / tau))
        speed = (1.0 - trust) * singer + trust * (speed0 + oscillation_gain(fit, ahead))
        mean = 0.5 * (before + speed)
        turn = bend * mean if abs(speed0) > 0.5 else state[belief_state.TURN_RATE]
        x[belief_state.SPEED], x[belief_state.TURN_RATE], x[belief_state.ACCELERATION] = mean, turn, 0.0
        advance_state(x, step, tau)
        x[belief_state.SPEED], x[belief_state.TURN_RATE] = (
            speed,
            bend * speed if abs(speed0) > 0.5 else state[belief_state.TURN_RATE],
        )
    x[belief_state.ACCELERATION] = 0.0


@njit
def board_at(future, step, t, out):
    """Interpolate `future` at `t` s from its first row into `out` ((8,)): cubic in position, linear in the rest.

    Beyond the last row that row is extrapolated on its arc.
    """
    last = future.shape[0] - 1
    k = min(int(max(t, 0.0) / step), last - 1)
    s = (t - k * step) / step
    a, b = future[k], future[k + 1]
    if s > 1.0:
        out[:] = b
        advance_state(out, t - last * step, 1.0)
        return
    turn = b[board_row.HEADING] - a[board_row.HEADING]
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    for i in range(board_row.DIM):
        out[i] = a[i] + s * (b[i] - a[i])
    out[board_row.HEADING] = a[board_row.HEADING] + s * turn
    h1, h2 = s * (1.0 - s) * (1.0 - s) * step, s * s * (s - 1.0) * step
    s2 = s * s * (3.0 - 2.0 * s)
    out[board_row.X] = (
        a[board_row.X]
        + s2 * (b[board_row.X] - a[board_row.X])
        + h1 * a[board_row.SPEED] * math.cos(a[board_row.HEADING])
        + h2 * b[board_row.SPEED] * math.cos(b[board_row.HEADING])
    )
    out[board_row.Y] = (
        a[board_row.Y]
        + s2 * (b[board_row.Y] - a[board_row.Y])
        + h1 * a[board_row.SPEED] * math.sin(a[board_row.HEADING])
        + h2 * b[board_row.SPEED] * math.sin(b[board_row.HEADING])
    )
