"""When the drone touches the board, how it touched, and what that is worth: paper Algorithm 1.

Contact is the collision criterion of Ji et al. (2022): the underside is a disc of radius `robot_r` at `robot_l` below
the centre of mass; it touches when its lowest point along the board's normal reaches the board's plane while the drone
is within `board_r + robot_r` of the board's centre. `success` is the paper's tolerance rule and nothing else;
whether the magnet would have held is judged apart (`attached`), because the paper counts neither impact speed nor the
board's edge.

Board frame: x up-slope (forward when flat), y left, z the outward normal.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import NamedTuple

import numpy as np

from kernel.jit import njit

ONGOING, FAIL, SUCCESS = 0, 1, 2
OUTCOMES = ("ongoing", "fail", "success")

NONE, GROUND, WORKSPACE, TIMEOUT, BEHIND, DISTANCE, SPEED, ALIGNMENT, INVALID = 0, 1, 2, 3, 4, 5, 6, 7, 8
REASONS = ("", "ground", "workspace", "time", "behind", "distance", "tangential_speed", "alignment", "not_finite")

# Indices of the (RESULT_DIM,) row `evaluate` fills.
OUTCOME, REASON, TOUCHED, WITHIN, ATTACHED = 0, 1, 2, 3, 4
X, Y, HEIGHT = 5, 6, 7  # m, board frame; HEIGHT is of the disc's lowest point over the board's plane
NORMAL_ERROR = 8  # rad, between body z and the board's normal
NORMAL_SPEED, TANGENTIAL_SPEED = 9, 10  # m/s relative to the board; normal is negative into the board
PLANAR = 11  # m, tangential distance from the board's centre
RESULT_DIM = 12

# Indices of the (RULES_DIM,) row of limits, in the order of the fields of `ContactRules`.
ROBOT_L, ROBOT_R, BOARD_R, BEHIND_DEPTH = 0, 1, 2, 3
DELTA_D, DELTA_V, DELTA_THETA = 4, 5, 6
GROUND_Z, WORKSPACE_XY, WORKSPACE_Z, TIME_LIMIT = 7, 8, 9, 10
BOARD_HALF, MAGNET_NORMAL_ERROR, MAGNET_TANGENTIAL, MAGNET_NORMAL_MIN, MAGNET_NORMAL_MAX = 11, 12, 13, 14, 15
RULES_DIM = 16


@dataclass(frozen=True)
class ContactRules:
    """Limits of Algorithm 1 and of the magnet. SI units, angles in rad.

    `delta_*`: the paper's tolerances. `robot_l`, `robot_r`: disc below the centre of mass; take them from the airframe.
    `board_r`: gate of the criterion; the default is half the diagonal of the 0.42 m board. `behind_depth`: the
    centre of mass this far behind the board's plane means it came from the wrong side.
    Workspace: limits of |x|, |y| and of z.

    Magnet (an assumption, not published: a small pot magnet on a sheet of steel): its contact point must lie on the
    board, flat enough to seat itself, slow enough along the board not to skid, and pressed on neither too softly to
    bridge the gap of the landing pads nor so hard that it bounces off.
    """

    robot_l: float = 0.05
    robot_r: float = 0.13
    board_r: float = 0.297
    behind_depth: float = 0.08
    delta_d: float = 0.2
    delta_v: float = 0.6
    delta_theta: float = 0.2
    ground_z: float = 0.15
    workspace_xy: float = 60.0
    workspace_z: float = 8.0
    time_limit: float = 5.0
    board_half: float = 0.21
    magnet_normal_error: float = 0.35
    magnet_tangential: float = 0.8
    magnet_normal_min: float = 0.05
    magnet_normal_max: float = 1.5

    def __post_init__(self) -> None:
        for name, value in zip(self.__dataclass_fields__, astuple(self), strict=True):
            if not math.isfinite(value):
                raise ValueError(f"contact rule {name} is {value}; give a finite number")
            if name != "ground_z" and value <= 0.0 and not (name in ("robot_l", "magnet_normal_min") and value == 0.0):
                raise ValueError(f"contact rule {name} is {value}; it must be positive")
        if self.magnet_normal_min >= self.magnet_normal_max:
            raise ValueError("contact rule magnet_normal_min must be below magnet_normal_max")

    def row(self) -> np.ndarray:
        """The (RULES_DIM,) row for kernels."""
        return np.array(astuple(self), dtype=np.float64)


class ContactView(NamedTuple):
    """One evaluation, named. m, rad, m/s; `normal_speed` is negative into the board."""

    outcome: str
    reason: str
    touched: bool
    within_tolerance: bool
    attached: bool
    x: float
    y: float
    planar: float
    height: float
    normal_error: float
    normal_speed: float
    tangential_speed: float


@njit
def relative_state(position, velocity, quaternion, body_rate, board, rules, out):
    """Fill the geometric part of `out` (X, Y, HEIGHT, PLANAR, NORMAL_ERROR, NORMAL_SPEED, TANGENTIAL_SPEED).

    `position`, `velocity` (3,) of the centre of mass, world; `quaternion` (4,) wxyz, world from body; `body_rate` (3,)
    body; `board` (8,) board row. X and Y are of the magnet: the disc's centre in the board frame. Speeds are of
    that point relative to the board's point under it (the board turns with the car).
    """
    qw, qx, qy, qz = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    zx, zy, zz = 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)
    ch, sh = math.cos(board[3]), math.sin(board[3])
    ci, si = math.cos(board[6]), math.sin(board[6])
    nx, ny, nz = -si * ch, -si * sh, ci
    ux, uy, uz = ci * ch, ci * sh, si
    length = rules[ROBOT_L]
    dx = position[0] - length * zx - board[0]
    dy = position[1] - length * zy - board[1]
    dz = position[2] - length * zz - board[2]
    # velocity of the disc's centre: v - l (R (w x e3)), with w x e3 = (wy, -wx, 0)
    wx, wy = body_rate[0], body_rate[1]
    bxx, bxy, bxz = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz), 2.0 * (qx * qz - qw * qy)
    byx, byy, byz = 2.0 * (qx * qy - qw * qz), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz + qw * qx)
    vx = velocity[0] - length * (wy * bxx - wx * byx) - (board[4] * ch - board[5] * dy)
    vy = velocity[1] - length * (wy * bxy - wx * byy) - (board[4] * sh + board[5] * dx)
    vz = velocity[2] - length * (wy * bxz - wx * byz)
    x = ux * dx + uy * dy + uz * dz
    y = -sh * dx + ch * dy
    cosine = min(1.0, max(-1.0, nx * zx + ny * zy + nz * zz))
    sine = math.sqrt(1.0 - cosine * cosine)
    out[X] = x
    out[Y] = y
    out[PLANAR] = math.sqrt(x * x + y * y)
    out[HEIGHT] = nx * dx + ny * dy + nz * dz - rules[ROBOT_R] * sine
    out[NORMAL_ERROR] = math.atan2(sine, cosine)
    normal = nx * vx + ny * vy + nz * vz
    out[NORMAL_SPEED] = normal
    along, across = ux * vx + uy * vy + uz * vz, -sh * vx + ch * vy
    out[TANGENTIAL_SPEED] = math.sqrt(along * along + across * across)


@njit
def _violation(position, elapsed, rules):
    if position[2] < rules[GROUND_Z]:
        return GROUND
    if max(abs(position[0]), abs(position[1])) > rules[WORKSPACE_XY] or position[2] > rules[WORKSPACE_Z]:
        return WORKSPACE
    return TIMEOUT if elapsed > rules[TIME_LIMIT] else NONE


@njit
def evaluate(position, velocity, quaternion, body_rate, board, elapsed, rules, out):
    """Algorithm 1 for one instant: fills `out` ((RESULT_DIM,)) and returns ONGOING, FAIL or SUCCESS.

    Arguments as `relative_state`; `elapsed` s since the attempt began. A state that is not finite is FAIL/INVALID.
    A violation is looked at before contact, as in the paper.
    """
    relative_state(position, velocity, quaternion, body_rate, board, rules, out)
    out[TOUCHED] = out[WITHIN] = out[ATTACHED] = 0.0
    dx, dy, dz = position[0] - board[0], position[1] - board[1], position[2] - board[2]
    if not (math.isfinite(out[HEIGHT]) and math.isfinite(out[NORMAL_SPEED]) and math.isfinite(out[TANGENTIAL_SPEED])):
        out[OUTCOME], out[REASON] = FAIL, INVALID
        return FAIL
    reason = _violation(position, elapsed, rules)
    reach = rules[BOARD_R] + rules[ROBOT_R]
    if reason == NONE and (out[HEIGHT] > 0.0 or dx * dx + dy * dy + dz * dz > reach * reach):
        out[OUTCOME], out[REASON] = ONGOING, NONE
        return ONGOING
    if reason == NONE:
        out[TOUCHED] = 1.0
        reason = _judge(dx, dy, dz, board, rules, out)
    out[REASON] = reason
    out[OUTCOME] = SUCCESS if reason == NONE else FAIL
    return SUCCESS if reason == NONE else FAIL


@njit
def _judge(dx, dy, dz, board, rules, out):
    """Tolerances and magnet at the instant of contact; the first broken tolerance is the reason."""
    si = math.sin(board[6])
    above = -si * math.cos(board[3]) * dx - si * math.sin(board[3]) * dy + math.cos(board[6]) * dz
    if above < -rules[BEHIND_DEPTH]:
        return BEHIND
    if (
        max(abs(out[X]), abs(out[Y])) <= rules[BOARD_HALF]
        and out[NORMAL_ERROR] <= rules[MAGNET_NORMAL_ERROR]
        and out[TANGENTIAL_SPEED] <= rules[MAGNET_TANGENTIAL]
        and -rules[MAGNET_NORMAL_MAX] <= out[NORMAL_SPEED] <= -rules[MAGNET_NORMAL_MIN]
    ):
        out[ATTACHED] = 1.0
    if out[PLANAR] > rules[DELTA_D]:
        return DISTANCE
    if out[TANGENTIAL_SPEED] > rules[DELTA_V]:
        return SPEED
    if out[NORMAL_ERROR] > rules[DELTA_THETA]:
        return ALIGNMENT
    out[WITHIN] = 1.0
    return NONE


@njit
def accuracy_bonus(result, rules):
    """w_s of Algorithm 1: mean of ((s - delta) / delta)^2 over distance, tangential speed, angle; 0..1 on success."""
    d = (result[PLANAR] - rules[DELTA_D]) / rules[DELTA_D]
    v = (result[TANGENTIAL_SPEED] - rules[DELTA_V]) / rules[DELTA_V]
    a = (result[NORMAL_ERROR] - rules[DELTA_THETA]) / rules[DELTA_THETA]
    return (d * d + v * v + a * a) / 3.0


def view(result: np.ndarray) -> ContactView:
    """Name the fields of a result row ((RESULT_DIM,))."""
    r = [float(value) for value in result]
    flags = (r[TOUCHED] > 0.5, r[WITHIN] > 0.5, r[ATTACHED] > 0.5)
    geometry = (r[X], r[Y], r[PLANAR], r[HEIGHT], r[NORMAL_ERROR], r[NORMAL_SPEED], r[TANGENTIAL_SPEED])
    return ContactView(OUTCOMES[int(r[OUTCOME])], REASONS[int(r[REASON])], *flags, *geometry)
