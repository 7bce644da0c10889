"""What the drone believes of the board: an extended Kalman filter on late, intermittent poses from the detector.

State (9): [x, y, z, heading, speed, turn_rate, inclination, acceleration, heading_bias]. The motion model is CTRV
(paper Sec. "Visibility-Aware Input Augmentation") with a forward acceleration that decays (Singer's model): with
`accel_sigma` and `calm_accel` 0 it is plain CTRV. How lively the board is driven is estimated beside it
(`belief_models`). Speed is signed, along the heading; z and inclination are constants that may drift slowly. Headings
are measured with a constant bias, as errors of mounting do not average out: where the board goes tells it.

Measurement (5): [x, y, z, heading + heading_bias, inclination], its covariance diagonal, gated by the Mahalanobis
distance. The filter stays at the newest exposure time and is predicted forward for output, so a measurement may be as
late as it likes; one older than the newest accepted is refused and counted. What the gate refuses is kept aside:
`reaccept` refusals in a row that agree with each other restart the filter there, so that no loss can lock it out.

One filter is one float64 row ((BELIEF_DIM,)); times are seconds from an origin of the caller's choice.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion.pose import board_normal
from kernel.jit import njit
from policies.estimation.ctrv import (
    ACCEL_TAU,
    BIAS_HEADING,
    GATE,
    LAMBDA_RHO,
    LIVELY,
    LOSS_AFTER,
    MAX_AGE,
    MAX_SPEED,
    MAX_TURN,
    REACCEPT,
    REACCEPT_LOSS,
    SPEED0,
    SPEED_SIGMA,
    TURN_SIGMA,
    TURN_TAU,
    VALID_AFTER,
    N,
    advance,
    advance_state,
    steps_in,
    wrap,
)
from policies.estimation.imm import MODEL_DIM, MODELS, combine, judge, mix, model_state, start_models

M = 5
_MEASURED = (0, 1, 2, 3, 6)  # indices of the state that a measurement sees

# Indices of a belief row. Slices: state B_X:B_X+N, covariance B_P:B_P+N*N (row-major).
B_X, B_P = 0, N
B_T = N + N * N  # s, exposure time of the newest accepted measurement
B_FIRST_T = B_T + 1  # s, of the first accepted one since the last (re)start
B_ACCEPTED, B_REJECTED, B_NIS = B_T + 2, B_T + 3, B_T + 4  # counts; B_NIS: innovation squared, of the newest one gated
B_STREAK = B_T + 5  # accepted since the last (re)start; 0: nothing is known
B_CANDIDATES, B_CANDIDATE_T, B_CANDIDATE_Z = (
    B_T + 6,
    B_T + 7,
    B_T + 8,
)  # refused in a row that agree; the newest of them
B_WEIGHTS = B_CANDIDATE_Z + M  # of the ways of driving
_ALL = MODELS * MODEL_DIM
_MODELS = B_WEIGHTS + MODELS
_TRIAL, _PRIOR, _MISFIT = _MODELS + _ALL, _MODELS + 2 * _ALL, _MODELS + 2 * _ALL + MODELS  # scratch
BELIEF_DIM = _MISFIT + 2 * MODELS

ACCEPTED, RESTARTED, GATED, OUT_OF_ORDER, NOT_FINITE, IMPLAUSIBLE = 0, 1, 2, 3, 4, 5
CODES = ("accepted", "restarted", "gated", "out_of_order", "not_finite", "implausible")


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
    z[3] = math.atan2(-yx, yy)
    z[4] = math.atan2(xz, zz)
    r[3] = sigma_rotation * sigma_rotation
    r[4] = sigma_rotation * sigma_rotation
    slack = 4.0 * sigma_rotation
    return abs(yz) < math.sin(min(1.5, 0.35 + slack)) and -0.2 - slack < z[4] < 1.75 + slack


@njit
def belief_reset(row):
    """Forget everything."""
    row[:] = 0.0


@njit
def _start(row, t, z, r, params, restart):
    """Begin at a measurement. A restart keeps the old speed and turn rate as the mean of the prior."""
    speed, turn = (row[B_X + 4], row[B_X + 5]) if restart else (params[SPEED0], 0.0)
    row[B_X:B_T] = 0.0
    for i in range(M):
        j = _MEASURED[i]
        row[B_X + j] = z[i]
        row[B_P + j * (N + 1)] = r[i]
    bias = params[BIAS_HEADING] ** 2
    row[B_P + 3 * (N + 1)] += bias
    row[B_P + 8 * (N + 1)] = bias
    row[B_P + 3 * N + 8] = row[B_P + 8 * N + 3] = -bias
    row[B_X + 4], row[B_X + 5] = speed, turn
    row[B_P + 4 * (N + 1)] = params[SPEED_SIGMA] ** 2
    row[B_P + 5 * (N + 1)] = params[TURN_SIGMA] ** 2
    start_models(row[B_X:B_P], row[B_P:B_T], params, r, row[B_WEIGHTS:_MODELS], row[_MODELS:_TRIAL])
    combine(row[B_WEIGHTS:_MODELS], row[_MODELS:_TRIAL], row[B_X:B_P], row[B_P:B_T])
    row[B_T], row[B_FIRST_T], row[B_STREAK], row[B_CANDIDATES] = t, t, 1.0, 0.0
    row[B_ACCEPTED] += 1.0


@njit
def _refused(row, t, z, r, params):
    """Count a gated measurement and compare it with the one refused before: True if enough in a row agree."""
    dt = t - row[B_CANDIDATE_T]
    agrees = row[B_CANDIDATES] > 0.0 and 0.0 < dt < 0.5
    if agrees:
        old = row[B_CANDIDATE_Z : B_CANDIDATE_Z + M]
        dx, dy, dz = z[0] - old[0], z[1] - old[1], z[2] - old[2]
        reach = params[MAX_SPEED] * dt + 4.0 * math.sqrt(r[0] + r[1] + r[2])
        agrees = (
            dx * dx + dy * dy + dz * dz < reach * reach
            and abs(wrap(z[3] - old[3])) < params[MAX_TURN] * dt + 5.0 * math.sqrt(r[3])
            and abs(z[4] - old[4]) < 0.02 + 5.0 * math.sqrt(r[4])
        )
    row[B_CANDIDATES] = row[B_CANDIDATES] + 1.0 if agrees else 1.0
    row[B_CANDIDATE_T] = t
    row[B_CANDIDATE_Z : B_CANDIDATE_Z + M] = z
    needed = 2.0 if t - row[B_T] > params[REACCEPT_LOSS] else params[REACCEPT]
    return row[B_CANDIDATES] >= needed


@njit
def belief_update(row, t, z, r, params):
    """Feed one measurement: `t` s its exposure, `z` (5,), `r` (5,) variances. Returns one of the codes above.

    Everything but ACCEPTED and RESTARTED leaves the estimate as it was and is counted in B_REJECTED.
    """
    fine = math.isfinite(t)
    for i in range(M):
        fine = fine and math.isfinite(z[i]) and math.isfinite(r[i]) and r[i] > 0.0
    if not fine:
        row[B_REJECTED] += 1.0
        return NOT_FINITE
    if row[B_STREAK] == 0.0:
        _start(row, t, z, r, params, False)
        return ACCEPTED
    if t <= row[B_T] or (row[B_CANDIDATES] > 0.0 and t <= row[B_CANDIDATE_T]):
        row[B_REJECTED] += 1.0
        return OUT_OF_ORDER
    weights, models, trial = row[B_WEIGHTS:_MODELS], row[_MODELS:_TRIAL], row[_TRIAL:_PRIOR]
    prior, misfits = row[_PRIOR:_MISFIT], row[_MISFIT:BELIEF_DIM]
    dt = t - row[B_T]
    mix(weights, models, dt, params, r, prior, trial, misfits)
    nis = math.inf
    for j in range(MODELS):
        x, p = model_state(trial, j)
        advance(x, p, dt, params, float(j))
        own, spread = _correct(x, p, z, r)
        misfits[j] = own + spread
        nis = min(nis, own)
    row[B_NIS] = nis
    if nis > params[GATE]:
        if _refused(row, t, z, r, params):
            _start(row, t, z, r, params, True)
            return RESTARTED
        row[B_REJECTED] += 1.0
        return GATED
    judge(prior, misfits, weights)
    models[:] = trial
    combine(weights, models, row[B_X:B_P], row[B_P:B_T])
    row[B_T] = t
    row[B_STREAK] += 1.0
    row[B_ACCEPTED] += 1.0
    row[B_CANDIDATES] = 0.0
    return ACCEPTED


@njit
def _correct(x, p, z, r):
    """Scalar updates one after the other, which for a diagonal R equal the joint one.

    Returns (the joint NIS, log of the innovation covariance's determinant).
    """
    nis, spread, seen = 0.0, 0.0, np.empty(N)  # seen: covariance of the state with what is measured
    for i in range(M):
        j = _MEASURED[i]
        biased = 1.0 if j == 3 else 0.0
        for a in range(N):
            seen[a] = p[a * N + j] + biased * p[a * N + 8]
        innovation = wrap(z[i] - x[j] - x[8]) if j == 3 else z[i] - x[j]
        s = seen[j] + biased * seen[8] + r[i]
        nis += innovation * innovation / s
        spread += math.log(s)
        for a in range(N):
            x[a] += seen[a] / s * innovation
            for b in range(N):
                p[a * N + b] -= seen[a] * seen[b] / s
    x[3] = wrap(x[3])
    return nis, spread


@njit
def belief_rho(row, t, params):
    """Reliability: 1 while measurements arrive, then exp(-lambda_rho T_loss); 0 before the first."""
    if row[B_STREAK] == 0.0:
        return 0.0
    return math.exp(-params[LAMBDA_RHO] * max(0.0, t - row[B_T] - params[LOSS_AFTER]))


@njit
def belief_predict(row, t, params, out):
    """Predict to time `t` (s) into a board row `out` ((8,)): [x, y, z, heading, speed, turn_rate, inclination, 0].

    While nothing is seen the turn rate decays, unlike the paper's (`BeliefParams`). Returns rho. Before the first
    measurement `out` is all zero and rho 0.
    """
    out[:] = row[B_X : B_X + 8]
    span = t - row[B_T]
    if row[B_STREAK] > 0.0 and span > 0.0:
        steps = steps_in(span)
        step = span / steps
        for k in range(steps):
            advance_state(out, step, params[ACCEL_TAU])
            unseen = min(step, (k + 1) * step - params[LOSS_AFTER])
            if unseen > 0.0:
                out[5] *= math.exp(-unseen / params[TURN_TAU])
        out[3] = wrap(out[3])
    out[7] = 0.0
    return belief_rho(row, t, params)


@njit
def belief_covariance(row, t, params, x, p):
    """Predict state (`x` (8,), the last is acceleration) and covariance (`p` (N * N,), row-major) to time `t` (s)."""
    x[:] = row[B_X : B_X + 8]
    p[:] = row[B_P : B_P + N * N]
    advance(x, p, t - row[B_T], params, row[B_WEIGHTS + LIVELY])
    x[3] = wrap(x[3])


@njit
def surface_sigma(row):
    """How well the board's surface was located when it was last seen: one sigma along its normal, m (at most 0.1).

    It tells good detectors from poor ones, where the predicted covariance tells how long ago they last saw.
    """
    if row[B_STREAK] == 0.0:
        return 0.1
    nx, ny, nz = board_normal(row[B_X:B_P])
    p = row[B_P : B_P + 3 * N]
    variance = nx * nx * p[0] + ny * ny * p[N + 1] + nz * nz * p[2 * N + 2]
    variance += 2.0 * (nx * ny * p[1] + nx * nz * p[2] + ny * nz * p[N + 2])
    return min(0.1, math.sqrt(max(0.0, variance)))


@njit
def belief_valid(row, t, params):
    """True once enough measurements were accepted since the last (re)start and the newest is not too old."""
    return row[B_STREAK] >= params[VALID_AFTER] and t - row[B_T] < params[MAX_AGE]
