"""The moment of contact, its geometry and its verdict: paper Algorithm 1.

Contact is the collision criterion of Ji et al. (2022): the underside is the airframe's contact disc, of radius ROBOT_R
at ROBOT_L below the centre of mass. Contact is when the disc's lowest point along the board's normal reaches the
board's plane while the vehicle is within BOARD_R + ROBOT_R of the board's centre. `success` is the paper's tolerance
rule alone. Whether the magnet holds is judged separately (`attached`), because the paper's rule includes neither the
impact speed nor the board's edge.

Board frame: x up-slope (forward when flat), y left, z the outward normal.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import NamedTuple

import numpy as np

from groundcar.motion import board_row
from kernel.jit import njit
from policies.task import result_row, rules_row
from vehicle.quadrotor.airframe import ContactGeometry

ONGOING, FAIL, SUCCESS = 0, 1, 2
OUTCOMES = ("ongoing", "fail", "success")

NONE, GROUND, WORKSPACE, TIMEOUT, BEHIND, DISTANCE, SPEED, ALIGNMENT, INVALID = 0, 1, 2, 3, 4, 5, 6, 7, 8
REASONS = ("", "ground", "workspace", "time", "behind", "distance", "tangential_speed", "alignment", "not_finite")


@dataclass(frozen=True)
class ContactRules:
    """Limits of Algorithm 1 and of the magnet. SI units, angles in rad.

    `delta_*`: the paper's tolerances. `board_r`: reach of the board, half the diagonal of the 0.42 m
    board by default. `behind_depth`: a centre of mass this far behind the board's plane at contact is a failure.
    Workspace: limits of |x|, |y| and of z.

    Raises ValueError for a rule that is not finite or not positive.

    Magnet (an assumption, not published: a small pot magnet on a sheet of steel): it holds if its contact point lies on
    the board, its normal error and tangential speed are small, and its normal speed is neither too low to close the gap
    of the landing pads nor so high that it bounces off.
    """

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
            if name != "ground_z" and value <= 0.0 and not (name == "magnet_normal_min" and value == 0.0):
                raise ValueError(f"contact rule {name} is {value}; it must be positive")
        if self.magnet_normal_min >= self.magnet_normal_max:
            raise ValueError("contact rule magnet_normal_min must be below magnet_normal_max")

    def row(self, disc: ContactGeometry) -> np.ndarray:
        """The rules row for kernels (policies.task.rules_row): these rules for the airframe's contact disc."""
        return np.array([disc.magnet_below, disc.footprint_radius, *astuple(self)], dtype=np.float64)


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
    """Fill X, Y, HEIGHT, PLANAR, NORMAL_ERROR, NORMAL_SPEED and TANGENTIAL_SPEED of `out` (policies.task.result_row).

    `position`, `velocity` (3,) of the centre of mass, world; `quaternion` (4,) wxyz, world from body; `body_rate` (3,)
    body; `board` (8,) board row. X and Y are those of the disc's centre, where the magnet is, in the board
    frame. Speeds are of that point relative to the board's point under it (the board turns with the car).
    """
    qw, qx, qy, qz = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    zx, zy, zz = 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)
    ch, sh = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    ci, si = math.cos(board[board_row.INCLINATION]), math.sin(board[board_row.INCLINATION])
    nx, ny, nz = -si * ch, -si * sh, ci
    ux, uy, uz = ci * ch, ci * sh, si
    length = rules[rules_row.ROBOT_L]
    dx = position[0] - length * zx - board[board_row.X]
    dy = position[1] - length * zy - board[board_row.Y]
    dz = position[2] - length * zz - board[board_row.Z]
    # velocity of the disc's centre: v - l (R (w x e3)), with w x e3 = (wy, -wx, 0)
    wx, wy = body_rate[0], body_rate[1]
    bxx, bxy, bxz = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz), 2.0 * (qx * qz - qw * qy)
    byx, byy, byz = 2.0 * (qx * qy - qw * qz), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz + qw * qx)
    vx = velocity[0] - length * (wy * bxx - wx * byx) - (board[board_row.SPEED] * ch - board[board_row.TURN_RATE] * dy)
    vy = velocity[1] - length * (wy * bxy - wx * byy) - (board[board_row.SPEED] * sh + board[board_row.TURN_RATE] * dx)
    vz = velocity[2] - length * (wy * bxz - wx * byz)
    x = ux * dx + uy * dy + uz * dz
    y = -sh * dx + ch * dy
    cosine = min(1.0, max(-1.0, nx * zx + ny * zy + nz * zz))
    sine = math.sqrt(1.0 - cosine * cosine)
    out[result_row.X] = x
    out[result_row.Y] = y
    out[result_row.PLANAR] = math.sqrt(x * x + y * y)
    out[result_row.HEIGHT] = nx * dx + ny * dy + nz * dz - rules[rules_row.ROBOT_R] * sine
    out[result_row.NORMAL_ERROR] = math.atan2(sine, cosine)
    normal = nx * vx + ny * vy + nz * vz
    out[result_row.NORMAL_SPEED] = normal
    along, across = ux * vx + uy * vy + uz * vz, -sh * vx + ch * vy
    out[result_row.TANGENTIAL_SPEED] = math.sqrt(along * along + across * across)


@njit
def _violation(position, elapsed, rules):
    if position[2] < rules[rules_row.GROUND_Z]:
        return GROUND
    if (
        max(abs(position[0]), abs(position[1])) > rules[rules_row.WORKSPACE_XY]
        or position[2] > rules[rules_row.WORKSPACE_Z]
    ):
        return WORKSPACE
    return TIMEOUT if elapsed > rules[rules_row.TIME_LIMIT] else NONE


@njit
def evaluate(position, velocity, quaternion, body_rate, board, elapsed, rules, out):
    """Algorithm 1 for one instant: fills `out` (policies.task.result_row) and returns ONGOING, FAIL or SUCCESS.

    Arguments as `relative_state`; `elapsed` s since the attempt began. A state that is not finite is FAIL/INVALID.
    Violations are tested before contact, as in the paper.
    """
    relative_state(position, velocity, quaternion, body_rate, board, rules, out)
    out[result_row.TOUCHED] = out[result_row.WITHIN] = out[result_row.ATTACHED] = 0.0
    dx, dy, dz = position[0] - board[board_row.X], position[1] - board[board_row.Y], position[2] - board[board_row.Z]
    if not (
        math.isfinite(out[result_row.HEIGHT])
        and math.isfinite(out[result_row.NORMAL_SPEED])
        and math.isfinite(out[result_row.TANGENTIAL_SPEED])
    ):
        out[result_row.OUTCOME], out[result_row.REASON] = FAIL, INVALID
        return FAIL
    reason = _violation(position, elapsed, rules)
    reach = rules[rules_row.BOARD_R] + rules[rules_row.ROBOT_R]
    if reason == NONE and (out[result_row.HEIGHT] > 0.0 or dx * dx + dy * dy + dz * dz > reach * reach):
        out[result_row.OUTCOME], out[result_row.REASON] = ONGOING, NONE
        return ONGOING
    if reason == NONE:
        out[result_row.TOUCHED] = 1.0
        reason = _judge(dx, dy, dz, board, rules, out)
    out[result_row.REASON] = reason
    out[result_row.OUTCOME] = SUCCESS if reason == NONE else FAIL
    return SUCCESS if reason == NONE else FAIL


@njit
def _judge(dx, dy, dz, board, rules, out):
    """Tolerances and magnet at the instant of contact; the first broken tolerance is the reason."""
    si = math.sin(board[board_row.INCLINATION])
    above = (
        -si * math.cos(board[board_row.HEADING]) * dx
        - si * math.sin(board[board_row.HEADING]) * dy
        + math.cos(board[board_row.INCLINATION]) * dz
    )
    if above < -rules[rules_row.BEHIND_DEPTH]:
        return BEHIND
    if (
        max(abs(out[result_row.X]), abs(out[result_row.Y])) <= rules[rules_row.BOARD_HALF]
        and out[result_row.NORMAL_ERROR] <= rules[rules_row.MAGNET_NORMAL_ERROR]
        and out[result_row.TANGENTIAL_SPEED] <= rules[rules_row.MAGNET_TANGENTIAL]
        and -rules[rules_row.MAGNET_NORMAL_MAX] <= out[result_row.NORMAL_SPEED] <= -rules[rules_row.MAGNET_NORMAL_MIN]
    ):
        out[result_row.ATTACHED] = 1.0
    if out[result_row.PLANAR] > rules[rules_row.DELTA_D]:
        return DISTANCE
    if out[result_row.TANGENTIAL_SPEED] > rules[rules_row.DELTA_V]:
        return SPEED
    if out[result_row.NORMAL_ERROR] > rules[rules_row.DELTA_THETA]:
        return ALIGNMENT
    out[result_row.WITHIN] = 1.0
    return NONE


@njit
def accuracy_bonus(result, rules):
    """w_s of Algorithm 1: mean of ((s - delta) / delta)^2 over distance, tangential speed, angle; 0..1 on success."""
    d = (result[result_row.PLANAR] - rules[rules_row.DELTA_D]) / rules[rules_row.DELTA_D]
    v = (result[result_row.TANGENTIAL_SPEED] - rules[rules_row.DELTA_V]) / rules[rules_row.DELTA_V]
    a = (result[result_row.NORMAL_ERROR] - rules[rules_row.DELTA_THETA]) / rules[rules_row.DELTA_THETA]
    return (d * d + v * v + a * a) / 3.0


def view(result: np.ndarray) -> ContactView:
    """The contact result row ((result_row.DIM,)) with named fields."""
    r = [float(value) for value in result]
    flags = (r[result_row.TOUCHED] > 0.5, r[result_row.WITHIN] > 0.5, r[result_row.ATTACHED] > 0.5)
    geometry = (
        r[result_row.X],
        r[result_row.Y],
        r[result_row.PLANAR],
        r[result_row.HEIGHT],
        r[result_row.NORMAL_ERROR],
        r[result_row.NORMAL_SPEED],
        r[result_row.TANGENTIAL_SPEED],
    )
    return ContactView(OUTCOMES[int(r[result_row.OUTCOME])], REASONS[int(r[result_row.REASON])], *flags, *geometry)
