"""Every term of the paper's reward (App. "Reward Formulations", Sec. "Active Perception Rewards") as kernels.

The printed act and aggressiveness terms are bonuses, so lingering pays unless the discount is short; weights are data
so that a recipe can scale them. Beyond the paper, with weight 0 by default: a penalty on normal impact speed outside a
band, because nothing printed bounds how hard a policy hits.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np

from kernel.jit import njit
from policies.task.contact import (
    DELTA_D,
    FAIL,
    NORMAL_ERROR,
    NORMAL_SPEED,
    OUTCOME,
    PLANAR,
    SUCCESS,
    TANGENTIAL_SPEED,
    TOUCHED,
    accuracy_bonus,
)

L1, L2, L3, L4, L5, L6, L7, L8 = 0, 1, 2, 3, 4, 5, 6, 7
L_FAIL, L_SUCCESS = 8, 9
ALPHA, BETA, GAMMA, TAU = 10, 11, 12, 13
V_LIM, W_LIM = 14, 15
L_IMPACT, IMPACT_LOW, IMPACT_HIGH, L_MISS = 16, 17, 18, 19
WEIGHTS_DIM = 20

_MEASURES = (PLANAR, TANGENTIAL_SPEED, NORMAL_ERROR)  # in the order of DELTA_D, DELTA_V, DELTA_THETA

# Indices of the (TERMS_DIM,) row of terms; the reward is their sum.
GUIDE, ALIGN, ACT, AGGR, TIME, ESTIMATE, PERCEPTION, TERMINAL, IMPACT = 0, 1, 2, 3, 4, 5, 6, 7, 8
TERMS_DIM = 9
TERMS = ("guide", "align", "act", "aggr", "time", "estimate", "perception", "terminal", "impact")


@dataclass(frozen=True)
class RewardWeights:
    """Paper's table "Hyperparameters for the reward function components", and the impact band (m/s, into the board).

    `impact`: cost per (m/s)^2 outside the band at a successful contact. `miss`: share of the failure penalty given back
    for touching close to tolerance (0: the paper), so that a near miss is worth more than staying away.
    """

    guide: float = 1.0
    pose_scale: float = 1.2
    axis: float = 2.7
    velocity: float = 1.5
    action: float = 4.0
    smoothness: float = 6.0
    aggressiveness: float = 1.5
    time: float = 4.0
    failure: float = -200.0
    success: float = 900.0
    alpha: float = 5.0
    beta: float = 1.5
    gamma: float = 0.3
    tau: float = 0.8
    v_lim: float = 5.0
    w_lim: float = 4.0
    impact: float = 0.0
    impact_low: float = 0.4
    impact_high: float = 0.65
    miss: float = 0.0

    def row(self) -> np.ndarray:
        """The (WEIGHTS_DIM,) row for kernels."""
        return np.array(astuple(self), dtype=np.float64)


@njit
def phi1(x):
    """1 / (1 + x^2)."""
    return 1.0 / (1.0 + x * x)


@njit
def phi2(x):
    """((cos x + 1) / 2)^2."""
    half = 0.5 * (math.cos(x) + 1.0)
    return half * half


@njit
def phi4(a, b):
    """exp(a - b) - 1."""
    return math.exp(a - b) - 1.0


@njit
def shaping(p, v, q, w, board, action, previous, weights, out):
    """Fill GUIDE, ALIGN, ACT, AGGR, TIME of `out`.

    `p`, `v` (3,) world, `q` (4,) wxyz world from body, `w` (3,) body rate; `board` (8,); actions (4,) in [-1, 1].
    Relative position and velocity are drone against board centre; z_rel is body z minus the board's normal.
    """
    qw, qx, qy, qz = q[0], q[1], q[2], q[3]
    zx, zy, zz = 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)
    ch, sh = math.cos(board[3]), math.sin(board[3])
    ci, si = math.cos(board[6]), math.sin(board[6])
    nx, ny, nz = -si * ch, -si * sh, ci
    dx, dy, dz = p[0] - board[0], p[1] - board[1], p[2] - board[2]
    ex, ey, ez = zx - nx, zy - ny, zz - nz
    vx, vy, vz = v[0] - board[4] * ch, v[1] - board[4] * sh, v[2]
    error = math.sqrt(dx * dx + dy * dy + dz * dz + ex * ex + ey * ey + ez * ez)
    angle = math.acos(min(1.0, max(-1.0, zx * nx + zy * ny + zz * nz)))
    guide = weights[L1] * phi1(weights[L2] * error)
    out[GUIDE] = guide
    closing = math.sqrt(vx * vx + vy * vy + vz * vz)
    out[ALIGN] = guide * (weights[L3] * phi2(angle) + phi1(weights[L4] * closing) + phi1(w[2]))
    size = change = 0.0
    for i in range(4):
        size += action[i] * action[i]
        change += (action[i] - previous[i]) * (action[i] - previous[i])
    out[ACT] = weights[L5] * math.exp(-math.sqrt(size)) + weights[L6] * math.exp(-math.sqrt(change))
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    rate = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    excess = 0.0
    if speed > weights[V_LIM]:
        excess += phi4(speed, weights[V_LIM])
    if rate > weights[W_LIM]:
        excess += phi4(rate, weights[W_LIM])
    out[AGGR] = weights[L7] * math.exp(-excess)
    out[TIME] = -weights[L8]


@njit
def active_perception(error, cosine, loss_seconds, weights, out):
    """Fill ESTIMATE and PERCEPTION: `error` m of the believed board position, `cosine` between the optical axis and the
    direction to the board, `loss_seconds` since the board was last seen."""
    gain = 1.0 + weights[ALPHA] * min(1.0, max(0.0, loss_seconds / weights[TAU]))
    out[ESTIMATE] = -weights[BETA] * gain * error
    out[PERCEPTION] = -weights[GAMMA] * (1.0 - cosine)


@njit
def terminal(result, rules, weights, out):
    """Fill TERMINAL (paper Algorithm 1, lines 1-13) and IMPACT from a contact result row and the contact rules row."""
    out[TERMINAL] = out[IMPACT] = 0.0
    if result[OUTCOME] == SUCCESS:
        out[TERMINAL] = weights[L_SUCCESS] * (1.0 + accuracy_bonus(result, rules))
        into = -result[NORMAL_SPEED]
        outside = max(weights[IMPACT_LOW] - into, into - weights[IMPACT_HIGH], 0.0)
        out[IMPACT] = -weights[L_IMPACT] * outside * outside
    elif result[OUTCOME] == FAIL:
        out[TERMINAL] = weights[L_FAIL]
        if result[TOUCHED] > 0.0 and weights[L_MISS] > 0.0:
            out[TERMINAL] *= 1.0 - weights[L_MISS] * closeness(result, rules)


@njit
def closeness(result, rules):
    """1 / (1 + mean of (s / delta)^2) over distance, tangential speed and angle of a contact; 1 is a perfect perch."""
    total = 0.0
    for i in range(3):
        ratio = result[_MEASURES[i]] / rules[DELTA_D + i]
        total += ratio * ratio
    return 1.0 / (1.0 + total / 3.0)


@njit
def total(terms):
    """Sum of a row of terms."""
    value = 0.0
    for i in range(TERMS_DIM):
        value += terms[i]
    return value
