"""Every term of the paper's reward (App. "Reward Formulations", Sec. "Active Perception Rewards") as kernels.

The paper's act and aggressiveness terms are positive at each step, so a long episode gains reward unless the discount
is short. Weights are data, so that a recipe can scale them. Beyond the paper, with weight 0 by default: a penalty on
normal impact speed outside a band, because no term of the paper bounds the impact speed.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np

from groundcar.motion import board_row
from kernel.jit import njit
from policies.task import result_row, rules_row, terms_row, weights_row
from policies.task.contact import FAIL, SUCCESS, accuracy_bonus
from vehicle.quadrotor import command_row

_MEASURES = (
    result_row.PLANAR,
    result_row.TANGENTIAL_SPEED,
    result_row.NORMAL_ERROR,
)  # in the order of DELTA_D, DELTA_V, DELTA_THETA

TERMS = ("guide", "align", "act", "aggr", "time", "estimate", "perception", "terminal", "impact")


@dataclass(frozen=True)
class RewardWeights:
    """Paper's table "Hyperparameters for the reward function components", and the impact band (m/s, into the board).

    `impact`: cost per (m/s)^2 outside the band at a successful contact. `miss`: share of the failure penalty
    that a contact close to the tolerances does not pay (0: the paper), so that it scores above no contact.
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
        """The weights row for kernels (policies.task.weights_row)."""
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
    Position and velocity are those of the vehicle relative to the board's centre; z_rel is body z minus the board's
    normal.
    """
    qw, qx, qy, qz = q[0], q[1], q[2], q[3]
    zx, zy, zz = 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)
    ch, sh = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    ci, si = math.cos(board[board_row.INCLINATION]), math.sin(board[board_row.INCLINATION])
    nx, ny, nz = -si * ch, -si * sh, ci
    dx, dy, dz = p[0] - board[board_row.X], p[1] - board[board_row.Y], p[2] - board[board_row.Z]
    ex, ey, ez = zx - nx, zy - ny, zz - nz
    vx, vy, vz = v[0] - board[board_row.SPEED] * ch, v[1] - board[board_row.SPEED] * sh, v[2]
    error = math.sqrt(dx * dx + dy * dy + dz * dz + ex * ex + ey * ey + ez * ez)
    angle = math.acos(min(1.0, max(-1.0, zx * nx + zy * ny + zz * nz)))
    guide = weights[weights_row.GUIDE] * phi1(weights[weights_row.POSE_SCALE] * error)
    out[terms_row.GUIDE] = guide
    closing = math.sqrt(vx * vx + vy * vy + vz * vz)
    out[terms_row.ALIGN] = guide * (
        weights[weights_row.AXIS] * phi2(angle) + phi1(weights[weights_row.VELOCITY] * closing) + phi1(w[2])
    )
    size = change = 0.0
    for i in range(command_row.DIM):
        size += action[i] * action[i]
        change += (action[i] - previous[i]) * (action[i] - previous[i])
    small, smooth = math.exp(-math.sqrt(size)), math.exp(-math.sqrt(change))
    out[terms_row.ACT] = weights[weights_row.ACTION] * small + weights[weights_row.SMOOTHNESS] * smooth
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    rate = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    excess = 0.0
    if speed > weights[weights_row.V_LIM]:
        excess += phi4(speed, weights[weights_row.V_LIM])
    if rate > weights[weights_row.W_LIM]:
        excess += phi4(rate, weights[weights_row.W_LIM])
    out[terms_row.AGGR] = weights[weights_row.AGGRESSIVENESS] * math.exp(-excess)
    out[terms_row.TIME] = -weights[weights_row.TIME]


@njit
def active_perception(error, cosine, loss_seconds, weights, out):
    """Fill ESTIMATE and PERCEPTION: `error` m of the believed board position, `cosine` between the optical axis and the
    direction to the board, `loss_seconds` since the board was last seen."""
    gain = 1.0 + weights[weights_row.ALPHA] * min(1.0, max(0.0, loss_seconds / weights[weights_row.TAU]))
    out[terms_row.ESTIMATE] = -weights[weights_row.BETA] * gain * error
    out[terms_row.PERCEPTION] = -weights[weights_row.GAMMA] * (1.0 - cosine)


@njit
def terminal(result, rules, weights, out):
    """Fill TERMINAL (paper Algorithm 1, lines 1-13) and IMPACT from a contact result row and the contact rules row."""
    out[terms_row.TERMINAL] = out[terms_row.IMPACT] = 0.0
    if result[result_row.OUTCOME] == SUCCESS:
        out[terms_row.TERMINAL] = weights[weights_row.SUCCESS] * (1.0 + accuracy_bonus(result, rules))
        into = -result[result_row.NORMAL_SPEED]
        outside = max(weights[weights_row.IMPACT_LOW] - into, into - weights[weights_row.IMPACT_HIGH], 0.0)
        out[terms_row.IMPACT] = -weights[weights_row.IMPACT] * outside * outside
    elif result[result_row.OUTCOME] == FAIL:
        out[terms_row.TERMINAL] = weights[weights_row.FAILURE]
        if result[result_row.TOUCHED] > 0.0 and weights[weights_row.MISS] > 0.0:
            out[terms_row.TERMINAL] *= 1.0 - weights[weights_row.MISS] * closeness(result, rules)


@njit
def closeness(result, rules):
    """1 / (1 + mean of (s / delta)^2) over distance, tangential speed and angle of a contact; 1 is a perfect perch."""
    total = 0.0
    for i in range(3):
        ratio = result[_MEASURES[i]] / rules[rules_row.DELTA_D + i]
        total += ratio * ratio
    return 1.0 / (1.0 + total / 3.0)


@njit
def total(terms):
    """Sum of a row of terms."""
    value = 0.0
    for i in range(terms_row.DIM):
        value += terms[i]
    return value
