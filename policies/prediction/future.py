"""Where the board will be: `future` rows (K, 8), board rows at a fixed step from now, which is all the planner sees.

Anything that fills such an array can stand here: the belief's own model below, a learned predictor, or the true motion
(the teacher with perfect foresight).
"""

from __future__ import annotations

import math

from kernel.jit import njit
from policies.estimation.ctrv import advance_state
from policies.prediction.speed_history import F_TRUST, swing_gain

HORIZON, STEP = 64, 0.05  # rows and seconds of the planner's future: 3.15 s

CONSTANT_VELOCITY, CTRV, CTRV_ACCELERATION = 0, 1, 2


@njit
def predict_future(state, kind, tau, step, out):
    """Fill `out` ((K, 8)); row 0 is now.

    `state` (8,): [x, y, z, heading, speed, turn_rate, inclination, acceleration] now; `kind` one of the constants
    above; `tau` s in which the acceleration decays. Constant velocity keeps the heading and drops the turn rate.
    """
    x = out[out.shape[0] - 1]  # the last row is filled last, so it may serve as the running state
    x[:] = state
    if kind == CONSTANT_VELOCITY:
        x[5] = 0.0
    if kind != CTRV_ACCELERATION:
        x[7] = 0.0
    for k in range(out.shape[0] - 1):
        out[k, :7] = x[:7]
        out[k, 7] = 0.0
        advance_state(x, step, tau)
    x[7] = 0.0


@njit
def carry_swing(state, fit, age, tau):
    """Correct a believed `state` ((8,), in place) that was carried over `age` s without a measurement.

    The filter lets the acceleration decay in `tau` s; where the `fit` of speed_history is trusted the speed swung on.
    """
    if fit[F_TRUST] <= 0.0 or age <= 0.0:
        return
    keep = math.exp(-age / tau)
    gained = state[7] / keep * tau * (1.0 - keep)
    # Metres and m/s of the swing over the gap (Simpson's rule), against those of the filter's own acceleration.
    back, middle = swing_gain(fit, -age), swing_gain(fit, -0.5 * age)
    swung = -back
    swung_far = age * (4.0 * (middle - back) + (0.0 - back)) / 6.0
    gained_far = state[7] / keep * tau * age - gained * tau
    faster, farther = fit[F_TRUST] * (swung - gained), fit[F_TRUST] * (swung_far - gained_far)
    state[0] += farther * math.cos(state[3])
    state[1] += farther * math.sin(state[3])
    state[4] += faster


@njit
def predict_swing(state, fit, tau, step, out):
    """Fill `out` ((K, 8)) as CTRV_ACCELERATION does, but as far as `fit` (of speed_history) is trusted it swings.

    The path's curvature is kept rather than the turn rate: a car that slows down in a bend turns more slowly.
    """
    trust, speed0 = fit[3], state[4]
    x = out[out.shape[0] - 1]
    x[:] = state
    bend = state[5] / speed0 if abs(speed0) > 0.5 else 0.0
    speed = speed0
    for k in range(out.shape[0] - 1):
        out[k, :7] = x[:7]
        out[k, 7] = 0.0
        before = speed
        ahead = (k + 1) * step
        singer = speed0 + state[7] * tau * (1.0 - math.exp(-ahead / tau))
        speed = (1.0 - trust) * singer + trust * (speed0 + swing_gain(fit, ahead))
        mean = 0.5 * (before + speed)
        turn = bend * mean if abs(speed0) > 0.5 else state[5]
        x[4], x[5], x[7] = mean, turn, 0.0
        advance_state(x, step, tau)
        x[4], x[5] = speed, bend * speed if abs(speed0) > 0.5 else state[5]
    x[7] = 0.0


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
    turn = b[3] - a[3]
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    for i in range(8):
        out[i] = a[i] + s * (b[i] - a[i])
    out[3] = a[3] + s * turn
    h1, h2 = s * (1.0 - s) * (1.0 - s) * step, s * s * (s - 1.0) * step
    s2 = s * s * (3.0 - 2.0 * s)
    out[0] = a[0] + s2 * (b[0] - a[0]) + h1 * a[4] * math.cos(a[3]) + h2 * b[4] * math.cos(b[3])
    out[1] = a[1] + s2 * (b[1] - a[1]) + h1 * a[4] * math.sin(a[3]) + h2 * b[4] * math.sin(b[3])
