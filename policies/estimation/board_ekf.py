"""The belief about the board: an extended Kalman filter on late, intermittent poses from the detector.

State (9): [x, y, z, heading, speed, turn_rate, inclination, acceleration, heading_bias]. The motion model is CTRV
(paper Sec. "Visibility-Aware Input Augmentation") with a forward acceleration that decays (Singer's model): with
`accel_sigma` and `calm_accel` 0 it is plain CTRV. Two sizes of the acceleration are filtered side by side
(policies/estimation/imm.py). Speed is signed, along the heading; z and inclination are constants that may drift slowly.
Headings are measured with a constant bias, because errors of mounting do not average out; the direction in which the
board moves makes it observable.

Measurement (5): [x, y, z, heading + heading_bias, inclination], its covariance diagonal, tested by the Mahalanobis
distance (innovation test). The filter stays at the newest exposure time and is predicted forward for output, so a
measurement may be late; one older than the newest accepted is refused and counted. Measurements that fail the
innovation test are kept as candidates: `reaccept` of them in a row that agree with each other restart the filter there,
so that after a loss it cannot refuse the board for good. After LONGEST s without an accepted measurement the next one
starts the filter. A filter asked for a time before its newest measurement knows nothing: one of the stamps is broken.

One filter is one belief row (policies.estimation.belief_row); times are seconds from an origin of the caller's choice.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion.pose import board_normal
from kernel import stamps
from kernel.jit import njit
from policies.estimation import belief_row, belief_state, filter_row, measured_row
from policies.estimation.ctrv import LIVELY, LONGEST, advance, advance_state, steps_in, wrap
from policies.estimation.imm import combine, judge, mix, model_state, start_models

# Indices of the state that a measurement sees, in the order of measured_row.
_MEASURED = (belief_state.X, belief_state.Y, belief_state.Z, belief_state.HEADING, belief_state.INCLINATION)

ACCEPTED, RESTARTED, GATED, OUT_OF_ORDER, NOT_FINITE, IMPLAUSIBLE, LATER_THAN_NOW = 0, 1, 2, 3, 4, 5, 6
CODES = ("accepted", "restarted", "gated", "out_of_order", "not_finite", "implausible", "later_than_now")
_CLOCK_ERROR = stamps.CLOCK_ERROR_NS * 1e-9 + 1e-6  # s, and the rounding of seconds


@njit
def measurement_from_pose(position, quaternion, sigma_position, sigma_rotation, z, r):
    """Fill `z`, `r` ((5,) each) from a pose of the board; False if it cannot be one of a board on a level car.

    `position` (3,) m; `quaternion` (4,) wxyz, world from board; `sigma_position` (3,) m along the world's axes;
    `sigma_rotation` rad about each axis. The heading is taken from the board's y axis, which stays horizontal whatever
    the inclination, so that a flat board has one too. A roll beyond 0.35 rad + 4 sigma is a detector's flip.
    """
    w, qx, qy, qz = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    yx, yy, yz = 2.0 * (qx * qy - w * qz), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz + w * qx)
    xz, zz = 2.0 * (qx * qz - w * qy), 1.0 - 2.0 * (qx * qx + qy * qy)
    for i in range(3):
        z[i] = position[i]
        r[i] = sigma_position[i] * sigma_position[i]
    z[measured_row.HEADING] = math.atan2(-yx, yy)
    z[measured_row.INCLINATION] = math.atan2(xz, zz)
    r[measured_row.HEADING] = sigma_rotation * sigma_rotation
    r[measured_row.INCLINATION] = sigma_rotation * sigma_rotation
    slack = 4.0 * sigma_rotation
    return abs(yz) < math.sin(min(1.5, 0.35 + slack)) and -0.2 - slack < z[measured_row.INCLINATION] < 1.75 + slack


@njit
def belief_reset(row):
    """Return to the state before the first measurement, counts included."""
    row[:] = 0.0


@njit(inline="always")
def _covariance(a, b):
    """Index in a belief row of the covariance of state numbers `a` and `b`."""
    return belief_row.COVARIANCE + a * belief_state.DIM + b


@njit
def _start(row, t, z, r, params, restart):
    """Begin at a measurement. A restart keeps the old speed and turn rate as the mean of the prior."""
    speed, turn = (
        (row[belief_row.STATE + belief_state.SPEED], row[belief_row.STATE + belief_state.TURN_RATE])
        if restart
        else (params[filter_row.SPEED0], 0.0)
    )
    row[belief_row.STATE : belief_row.TIME] = 0.0
    for i in range(measured_row.DIM):
        j = _MEASURED[i]
        row[belief_row.STATE + j] = z[i]
        row[_covariance(j, j)] = r[i]
    bias = params[filter_row.BIAS_HEADING] ** 2
    row[_covariance(belief_state.HEADING, belief_state.HEADING)] += bias
    row[_covariance(belief_state.HEADING_BIAS, belief_state.HEADING_BIAS)] = bias
    row[_covariance(belief_state.HEADING, belief_state.HEADING_BIAS)] = -bias
    row[_covariance(belief_state.HEADING_BIAS, belief_state.HEADING)] = -bias
    row[belief_row.STATE + belief_state.SPEED], row[belief_row.STATE + belief_state.TURN_RATE] = speed, turn
    row[_covariance(belief_state.SPEED, belief_state.SPEED)] = params[filter_row.SPEED_SIGMA] ** 2
    row[_covariance(belief_state.TURN_RATE, belief_state.TURN_RATE)] = params[filter_row.TURN_SIGMA] ** 2
    start_models(
        row[belief_row.STATE : belief_row.COVARIANCE],
        row[belief_row.COVARIANCE : belief_row.TIME],
        params,
        r,
        row[belief_row.WEIGHTS : belief_row.MODELS],
        row[belief_row.MODELS : belief_row.TRIAL],
    )
    combine(
        row[belief_row.WEIGHTS : belief_row.MODELS],
        row[belief_row.MODELS : belief_row.TRIAL],
        row[belief_row.STATE : belief_row.COVARIANCE],
        row[belief_row.COVARIANCE : belief_row.TIME],
    )
    row[belief_row.TIME] = row[belief_row.FIRST_TIME] = t
    row[belief_row.STREAK], row[belief_row.CANDIDATES] = 1.0, 0.0
    row[belief_row.ACCEPTED] += 1.0


@njit
def _refused(row, t, z, r, params):
    """Count a refused measurement and compare it with the one refused before: True if enough in a row agree."""
    dt = t - row[belief_row.CANDIDATE_TIME]
    agrees = row[belief_row.CANDIDATES] > 0.0 and 0.0 < dt < 0.5
    if agrees:
        old = row[belief_row.CANDIDATE : belief_row.CANDIDATE + measured_row.DIM]
        dx, dy, dz = (
            z[measured_row.X] - old[measured_row.X],
            z[measured_row.Y] - old[measured_row.Y],
            z[measured_row.Z] - old[measured_row.Z],
        )
        reach = params[filter_row.MAX_SPEED] * dt + 4.0 * math.sqrt(
            r[measured_row.X] + r[measured_row.Y] + r[measured_row.Z]
        )
        agrees = (
            dx * dx + dy * dy + dz * dz < reach * reach
            and abs(wrap(z[measured_row.HEADING] - old[measured_row.HEADING]))
            < params[filter_row.MAX_TURN] * dt + 5.0 * math.sqrt(r[measured_row.HEADING])
            and abs(z[measured_row.INCLINATION] - old[measured_row.INCLINATION])
            < 0.02 + 5.0 * math.sqrt(r[measured_row.INCLINATION])
        )
    row[belief_row.CANDIDATES] = row[belief_row.CANDIDATES] + 1.0 if agrees else 1.0
    row[belief_row.CANDIDATE_TIME] = t
    row[belief_row.CANDIDATE : belief_row.CANDIDATE + measured_row.DIM] = z
    needed = 2.0 if t - row[belief_row.TIME] > params[filter_row.REACCEPT_LOSS] else params[filter_row.REACCEPT]
    return row[belief_row.CANDIDATES] >= needed


@njit
def belief_update(row, t, z, r, params):
    """Feed one measurement: `t` s its exposure, `z` (5,), `r` (5,) variances. Returns one of the codes above.

    Everything but ACCEPTED and RESTARTED leaves the estimate as it was and is counted in REJECTED.
    """
    fine = math.isfinite(t)
    for i in range(measured_row.DIM):
        fine = fine and math.isfinite(z[i]) and math.isfinite(r[i]) and r[i] > 0.0
    if not fine:
        row[belief_row.REJECTED] += 1.0
        return NOT_FINITE
    if row[belief_row.STREAK] == 0.0:
        _start(row, t, z, r, params, False)
        return ACCEPTED
    if t - row[belief_row.TIME] > LONGEST:
        _start(row, t, z, r, params, False)
        return RESTARTED
    if t <= row[belief_row.TIME] or (row[belief_row.CANDIDATES] > 0.0 and t <= row[belief_row.CANDIDATE_TIME]):
        row[belief_row.REJECTED] += 1.0
        return OUT_OF_ORDER
    weights, models, trial = (
        row[belief_row.WEIGHTS : belief_row.MODELS],
        row[belief_row.MODELS : belief_row.TRIAL],
        row[belief_row.TRIAL : belief_row.PRIOR],
    )
    prior, misfits = row[belief_row.PRIOR : belief_row.MISFIT], row[belief_row.MISFIT : belief_row.DIM]
    dt = t - row[belief_row.TIME]
    mix(weights, models, dt, params, r, prior, trial, misfits)
    nis = math.inf
    for j in range(belief_row.MODEL_COUNT):
        x, p = model_state(trial, j)
        advance(x, p, dt, params, float(j))
        own, spread = _correct(x, p, z, r)
        misfits[j] = own + spread
        nis = min(nis, own)
    row[belief_row.NIS] = nis
    if nis > params[filter_row.GATE]:
        if _refused(row, t, z, r, params):
            _start(row, t, z, r, params, True)
            return RESTARTED
        row[belief_row.REJECTED] += 1.0
        return GATED
    judge(prior, misfits, weights)
    models[:] = trial
    combine(
        weights, models, row[belief_row.STATE : belief_row.COVARIANCE], row[belief_row.COVARIANCE : belief_row.TIME]
    )
    row[belief_row.TIME] = t
    row[belief_row.STREAK] += 1.0
    row[belief_row.ACCEPTED] += 1.0
    row[belief_row.CANDIDATES] = 0.0
    return ACCEPTED


@njit
def _correct(x, p, z, r):
    """Scalar updates one after the other, which for a diagonal R equal the joint one.

    Returns (the joint NIS, log of the innovation covariance's determinant).
    """
    nis, spread, seen = 0.0, 0.0, np.empty(belief_state.DIM)  # seen: covariance of the state with what is measured
    for i in range(measured_row.DIM):
        j = _MEASURED[i]
        biased = 1.0 if j == belief_state.HEADING else 0.0
        for a in range(belief_state.DIM):
            seen[a] = p[a * belief_state.DIM + j] + biased * p[a * belief_state.DIM + belief_state.HEADING_BIAS]
        innovation = wrap(z[i] - x[j] - x[belief_state.HEADING_BIAS]) if j == belief_state.HEADING else z[i] - x[j]
        s = seen[j] + biased * seen[belief_state.HEADING_BIAS] + r[i]
        nis += innovation * innovation / s
        spread += math.log(s)
        for a in range(belief_state.DIM):
            x[a] += seen[a] / s * innovation
            for b in range(belief_state.DIM):
                p[a * belief_state.DIM + b] -= seen[a] * seen[b] / s
    x[belief_state.HEADING] = wrap(x[belief_state.HEADING])
    return nis, spread


@njit
def belief_age(row, t):
    """Seconds at `t` (s) since the newest accepted measurement; infinite if that is later than `t`."""
    age = t - row[belief_row.TIME]
    return age if age > -_CLOCK_ERROR else math.inf


@njit
def belief_rho(row, t, params):
    """Reliability: 1 while measurements arrive, then exp(-lambda_rho T_loss); 0 before the first."""
    if row[belief_row.STREAK] == 0.0:
        return 0.0
    return math.exp(-params[filter_row.LAMBDA_RHO] * max(0.0, belief_age(row, t) - params[filter_row.LOSS_AFTER]))


@njit
def belief_predict(row, t, params, out):
    """Predict to time `t` (s) into a board row `out` ((8,)): [x, y, z, heading, speed, turn_rate, inclination, 0].

    Without detections the turn rate decays, unlike the paper's (`BeliefParams`). Returns rho. Before the first
    measurement `out` is all zero and rho 0. The prediction goes no further than LONGEST.
    """
    out[:] = row[belief_row.STATE : belief_row.STATE + belief_state.PREDICTED_DIM]
    span = min(t - row[belief_row.TIME], LONGEST)
    if row[belief_row.STREAK] > 0.0 and span > 0.0:
        steps = steps_in(span)
        step = span / steps
        for k in range(steps):
            advance_state(out, step, params[filter_row.ACCEL_TAU])
            unseen = min(step, (k + 1) * step - params[filter_row.LOSS_AFTER])
            if unseen > 0.0:
                out[belief_state.TURN_RATE] *= math.exp(-unseen / params[filter_row.TURN_TAU])
        out[belief_state.HEADING] = wrap(out[belief_state.HEADING])
    out[belief_state.ACCELERATION] = 0.0
    return belief_rho(row, t, params)


@njit
def belief_covariance(row, t, params, x, p):
    """Predict state (`x` (8,), the last is acceleration) and covariance (`p` (81,), row-major) to time `t` (s)."""
    x[:] = row[belief_row.STATE : belief_row.STATE + belief_state.PREDICTED_DIM]
    p[:] = row[belief_row.COVARIANCE : belief_row.TIME]
    advance(x, p, t - row[belief_row.TIME], params, row[belief_row.WEIGHTS + LIVELY])
    x[belief_state.HEADING] = wrap(x[belief_state.HEADING])


@njit
def surface_sigma(row):
    """How well the board's surface was located when it was last seen: one sigma along its normal, m (at most 0.1).

    It measures the detector's quality, whereas the predicted covariance grows with the time since the last detection.
    """
    if row[belief_row.STREAK] == 0.0:
        return 0.1
    nx, ny, nz = board_normal(row[belief_row.STATE : belief_row.COVARIANCE])
    x, y, z = belief_state.X, belief_state.Y, belief_state.Z
    variance = nx * nx * row[_covariance(x, x)] + ny * ny * row[_covariance(y, y)] + nz * nz * row[_covariance(z, z)]
    variance += 2.0 * (
        nx * ny * row[_covariance(x, y)] + nx * nz * row[_covariance(x, z)] + ny * nz * row[_covariance(y, z)]
    )
    return min(0.1, math.sqrt(max(0.0, variance)))


@njit
def belief_valid(row, t, params):
    """True once enough measurements were accepted since the last (re)start and the newest is not too old."""
    return row[belief_row.STREAK] >= params[filter_row.VALID_AFTER] and belief_age(row, t) < params[filter_row.MAX_AGE]
