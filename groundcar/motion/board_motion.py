"""The board's motion along its path as kernels: in training, as the follower's reference, and as the known future.

A board row (8,) is [x, y, z, heading, speed (signed), turn rate, inclination, u]; its aux row (A,) holds everything
else of one board: what it does (path row, speed row, change of path, how sluggishly it answers) and where it is in
doing so (the first entries). Rows are plain float64, so 2-D arrays of them map over prange.

Two ways to imitate a real car, which does not follow exactly: ACCEL_LIMIT bounds the acceleration; RESPONSE > 0 makes
speed follow the law as a second-order system of natural frequency RESPONSE (rad/s) and damping DAMPING, which
overshoots below 0.7 and is a mere lag above 1. The board stays on its path: only its timing changes.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion.kinematics import wrap
from groundcar.motion.paths import HEADING as PATH_HEADING
from groundcar.motion.paths import LINE, SIZE, STATIC, P, path_curvature, path_eval, path_lap
from groundcar.motion.speed_laws import SWITCH, S, speed_law, speed_nominal
from kernel.jit import njit

X, Y, Z, HEADING, SPEED, TURN_RATE, INCLINATION, U = range(8)  # board row

TIME = 0  # s since the start
ETA = 1  # state of the speed law
ACCEL = 2  # m/s^2, of the law's speed as answered
LAW_SPEED = 3  # m/s, the law's speed as answered; on a line the peak speed, else that of the row
TRAVELLED = 4  # m
CHANGED = 5  # 1 once the path has become an arc; then ARC_X, ARC_Y (m) is its centre, ARC_ANGLE (rad) where it began
ARC_X, ARC_Y, ARC_ANGLE = 6, 7, 8
SLOPE = 9  # m per unit of u where the board is: how fast u must grow
CHANGE_TIME = 10  # s, when the path becomes an arc; inf: never
CHANGE_LENGTH = 11  # m travelled, the same
ARC_RADIUS = 12  # m, positive to the left
RESPONSE, DAMPING = 13, 14  # rad/s, 1
ACCEL_LIMIT = 15  # m/s^2
PATH_KIND, SPEED_KIND = 16, 17
SPEED_ROW = 18
PATH_ROW = SPEED_ROW + S
A = PATH_ROW + P


@njit
def _where(aux, u):
    """(x, y, heading, slope, curvature) of the path in force at u; slope is what speed is divided by for du/dt.

    A line's phase advances evenly, x = A sin(v t / A), so its slope is A; a static path's is infinite.
    """
    if aux[CHANGED] > 0.0:
        turn = 1.0 if aux[ARC_RADIUS] > 0.0 else -1.0
        radius, angle = abs(aux[ARC_RADIUS]), aux[ARC_ANGLE] + turn * u
        x, y = aux[ARC_X] + radius * math.cos(angle), aux[ARC_Y] + radius * math.sin(angle)
        return x, y, angle + turn * 0.5 * math.pi, radius, turn / radius
    kind = int(aux[PATH_KIND])
    params = aux[PATH_ROW : PATH_ROW + P]
    x, y, dx, dy, ddx, ddy = path_eval(kind, params, u)
    if kind == LINE:
        return x, y, params[PATH_HEADING], params[SIZE], 0.0
    if kind == STATIC:
        return x, y, params[PATH_HEADING], math.inf, 0.0
    return x, y, math.atan2(dy, dx), max(math.sqrt(dx * dx + dy * dy), 1e-9), path_curvature(dx, dy, ddx, ddy)


@njit
def _show(row, aux):
    """Write the pose and twist that belong to row[U] and aux[LAW_SPEED]."""
    x, y, heading, slope, curvature = _where(aux, row[U])
    row[X], row[Y], row[HEADING] = x, y, wrap(heading)
    aux[SLOPE] = slope
    speed = aux[LAW_SPEED]
    if aux[CHANGED] == 0.0:
        kind = int(aux[PATH_KIND])
        if kind == LINE:
            speed *= math.cos(row[U])
        elif kind == STATIC:
            speed = 0.0
    row[SPEED], row[TURN_RATE] = speed, speed * curvature


@njit
def _change_path(row, aux):
    """Leave the path on the tangent arc of ARC_RADIUS; a scheduled speed law begins to change now."""
    left = aux[ARC_RADIUS]
    aux[ARC_X] = row[X] - left * math.sin(row[HEADING])
    aux[ARC_Y] = row[Y] + left * math.cos(row[HEADING])
    aux[ARC_ANGLE] = math.atan2(row[Y] - aux[ARC_Y], row[X] - aux[ARC_X])
    aux[CHANGED] = 1.0
    aux[SPEED_ROW + SWITCH] = aux[TIME]
    row[U] = 0.0


@njit
def _advance(row, aux, dt, asked):
    """Move on by dt at the law's speed `asked`, as answered."""
    if aux[CHANGED] == 0.0 and (aux[TIME] >= aux[CHANGE_TIME] or aux[TRAVELLED] >= aux[CHANGE_LENGTH]):
        _change_path(row, aux)
    before, limit = aux[LAW_SPEED], aux[ACCEL_LIMIT]
    if aux[RESPONSE] > 0.0:
        pull = aux[RESPONSE] * aux[RESPONSE] * (asked - before) - 2.0 * aux[DAMPING] * aux[RESPONSE] * aux[ACCEL]
        aux[ACCEL] = max(-limit, min(limit, aux[ACCEL] + pull * dt))
    else:
        aux[ACCEL] = max(-limit, min(limit, (asked - before) / dt))
    aux[LAW_SPEED] = before + aux[ACCEL] * dt
    mean = 0.5 * (before + aux[LAW_SPEED])
    middle = row[U] + 0.5 * dt * mean / aux[SLOPE]
    row[U] += dt * mean / _where(aux, middle)[3]
    if aux[CHANGED] == 0.0:
        lap = path_lap(int(aux[PATH_KIND]), aux[PATH_ROW : PATH_ROW + P])
        row[U] -= lap * math.floor(row[U] / lap)
    aux[TIME] += dt
    _show(row, aux)
    aux[TRAVELLED] += abs(row[SPEED]) * dt


@njit
def motion_reset(row, aux, u, z, inclination, moving):
    """Start over at path parameter `u`, board centre `z` m up, tilted by `inclination` rad.

    `moving` True: already at the law's speed; False: from rest. A path that had become an arc is itself again.
    """
    if aux[CHANGED] > 0.0:
        aux[SPEED_ROW + SWITCH] = math.inf
    for i in range(CHANGE_TIME):
        aux[i] = 0.0
    row[Z], row[INCLINATION], row[U] = z, inclination, u
    if moving:
        aux[LAW_SPEED] = speed_nominal(int(aux[SPEED_KIND]), aux[SPEED_ROW : SPEED_ROW + S], 0.0)
    _show(row, aux)


@njit
def motion_step(row, aux, dt, stream):
    """Advance the board by `dt` s (meant for 0.002 to 0.02). `stream` is touched only by a perturbed speed law."""
    kind, params = int(aux[SPEED_KIND]), aux[SPEED_ROW : SPEED_ROW + S]
    _advance(row, aux, dt, speed_law(kind, params, aux[ETA : ETA + 1], aux[TIME] + dt, dt, stream))


@njit
def motion_future(row, aux, dt, n, out):
    """Write the next `n` board rows, `dt` s apart, to `out` (>= n, 8): the paper's privileged future.

    No randomness: the speed law's OU factor stays what it is. `row` is not changed; `aux` is restored before returning.
    """
    kind, params = int(aux[SPEED_KIND]), aux[SPEED_ROW : SPEED_ROW + S]
    saved = (aux[0], aux[1], aux[2], aux[3], aux[4], aux[5], aux[6], aux[7], aux[8], aux[9])
    switch, factor = aux[SPEED_ROW + SWITCH], math.exp(aux[ETA])
    for k in range(n):
        for i in range(8):
            out[k, i] = row[i] if k == 0 else out[k - 1, i]
        _advance(out[k], aux, dt, speed_nominal(kind, params, aux[TIME] + dt) * factor)
    for i in range(10):
        aux[i] = saved[i]
    aux[SPEED_ROW + SWITCH] = switch


def motion_aux(
    path_kind: int,
    path_row: np.ndarray,
    speed_kind: int,
    speed_row: np.ndarray,
    *,
    change_time: float = math.inf,
    change_length: float = math.inf,
    arc_radius: float = 0.0,
    response: float = 0.0,
    damping: float = 1.0,
    accel_limit: float = math.inf,
) -> np.ndarray:
    """An aux row (A,) of what a board does; call `motion_reset` next. Raises ValueError.

    `change_time` (s) or `change_length` (m), whichever comes first, turns the path into the tangent arc of `arc_radius`
    (m, positive to the left; paper's Hard-II).
    """
    if path_row.shape != (P,) or speed_row.shape != (S,):
        raise ValueError(f"need a path row ({P},) and a speed row ({S},), not {path_row.shape} and {speed_row.shape}")
    if math.isfinite(min(change_time, change_length)) and abs(arc_radius) < 0.1:
        raise ValueError(f"a change of path needs an arc radius of at least 0.1 m, not {arc_radius}")
    if not (accel_limit > 0.0 and response >= 0.0 and damping > 0.0):
        raise ValueError(f"accel_limit, damping must be > 0 and response >= 0: {accel_limit, damping, response}")
    aux = np.zeros(A)
    aux[CHANGE_TIME], aux[CHANGE_LENGTH], aux[ARC_RADIUS] = change_time, change_length, arc_radius
    aux[RESPONSE], aux[DAMPING], aux[ACCEL_LIMIT] = response, damping, accel_limit
    aux[PATH_KIND], aux[SPEED_KIND] = path_kind, speed_kind
    aux[SPEED_ROW : SPEED_ROW + S], aux[PATH_ROW : PATH_ROW + P] = speed_row, path_row
    return aux
