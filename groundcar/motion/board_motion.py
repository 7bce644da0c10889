"""The board's motion along its path as kernels: in training, as the follower's reference, and as the known future.

The board row (groundcar.motion.board_row) is what others read. The aux row (groundcar.motion.motion_row) holds
everything else of one board: its path, its speed law, the change of path, its response, and the state of the motion.
Rows are plain float64, so that 2-D arrays of them map over prange.

Two ways to imitate a real car, which does not follow exactly: ACCEL_LIMIT bounds the acceleration; RESPONSE > 0 makes
speed follow the law as a second-order system of natural frequency RESPONSE (rad/s) and damping DAMPING, which
overshoots below 0.7 and does not above 1. The board stays on its path: only its timing changes.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import board_row, motion_row, path_row, speed_row
from groundcar.motion.kinematics import wrap
from groundcar.motion.paths import LINE, STATIC, path_curvature, path_eval, path_lap
from groundcar.motion.speed_laws import speed_law, speed_nominal
from kernel.jit import njit


@njit
def _where(aux, u):
    """(x, y, heading, slope, curvature) of the path in force at u; slope is what speed is divided by for du/dt.

    A line's phase advances evenly, x = A sin(v t / A), so its slope is A; a static path's is infinite.
    """
    if aux[motion_row.CHANGED] > 0.0:
        turn = 1.0 if aux[motion_row.ARC_RADIUS] > 0.0 else -1.0
        radius, angle = abs(aux[motion_row.ARC_RADIUS]), aux[motion_row.ARC_ANGLE] + turn * u
        x, y = aux[motion_row.ARC_X] + radius * math.cos(angle), aux[motion_row.ARC_Y] + radius * math.sin(angle)
        return x, y, angle + turn * 0.5 * math.pi, radius, turn / radius
    kind = int(aux[motion_row.PATH_KIND])
    params = aux[motion_row.PATH : motion_row.PATH + path_row.DIM]
    x, y, dx, dy, ddx, ddy = path_eval(kind, params, u)
    if kind == LINE:
        return x, y, params[path_row.HEADING], params[path_row.SIZE], 0.0
    if kind == STATIC:
        return x, y, params[path_row.HEADING], math.inf, 0.0
    return x, y, math.atan2(dy, dx), max(math.sqrt(dx * dx + dy * dy), 1e-9), path_curvature(dx, dy, ddx, ddy)


@njit
def _show(row, aux):
    """Write the pose and twist that belong to row[U] and aux[LAW_SPEED]."""
    x, y, heading, slope, curvature = _where(aux, row[board_row.U])
    row[board_row.X], row[board_row.Y], row[board_row.HEADING] = x, y, wrap(heading)
    aux[motion_row.SLOPE] = slope
    speed = aux[motion_row.LAW_SPEED]
    if aux[motion_row.CHANGED] == 0.0:
        kind = int(aux[motion_row.PATH_KIND])
        if kind == LINE:
            speed *= math.cos(row[board_row.U])
        elif kind == STATIC:
            speed = 0.0
    row[board_row.SPEED], row[board_row.TURN_RATE] = speed, speed * curvature


@njit
def _change_path(row, aux):
    """Leave the path on the tangent arc of ARC_RADIUS; a scheduled speed law begins to change now."""
    left = aux[motion_row.ARC_RADIUS]
    aux[motion_row.ARC_X] = row[board_row.X] - left * math.sin(row[board_row.HEADING])
    aux[motion_row.ARC_Y] = row[board_row.Y] + left * math.cos(row[board_row.HEADING])
    aux[motion_row.ARC_ANGLE] = math.atan2(
        row[board_row.Y] - aux[motion_row.ARC_Y], row[board_row.X] - aux[motion_row.ARC_X]
    )
    aux[motion_row.CHANGED] = 1.0
    aux[motion_row.SPEED + speed_row.SWITCH] = aux[motion_row.TIME]
    row[board_row.U] = 0.0


@njit
def _advance(row, aux, dt, asked):
    """Advance by dt; `asked` is the law's speed, which the board answers with its response."""
    if aux[motion_row.CHANGED] == 0.0 and (
        aux[motion_row.TIME] >= aux[motion_row.CHANGE_TIME]
        or aux[motion_row.TRAVELLED] >= aux[motion_row.CHANGE_LENGTH]
    ):
        _change_path(row, aux)
    before, limit = aux[motion_row.LAW_SPEED], aux[motion_row.ACCEL_LIMIT]
    if aux[motion_row.RESPONSE] > 0.0:
        pull = (
            aux[motion_row.RESPONSE] * aux[motion_row.RESPONSE] * (asked - before)
            - 2.0 * aux[motion_row.DAMPING] * aux[motion_row.RESPONSE] * aux[motion_row.ACCEL]
        )
        aux[motion_row.ACCEL] = max(-limit, min(limit, aux[motion_row.ACCEL] + pull * dt))
    else:
        aux[motion_row.ACCEL] = max(-limit, min(limit, (asked - before) / dt))
    aux[motion_row.LAW_SPEED] = before + aux[motion_row.ACCEL] * dt
    mean = 0.5 * (before + aux[motion_row.LAW_SPEED])
    middle = row[board_row.U] + 0.5 * dt * mean / aux[motion_row.SLOPE]
    row[board_row.U] += dt * mean / _where(aux, middle)[3]
    if aux[motion_row.CHANGED] == 0.0:
        lap = path_lap(int(aux[motion_row.PATH_KIND]), aux[motion_row.PATH : motion_row.PATH + path_row.DIM])
        row[board_row.U] -= lap * math.floor(row[board_row.U] / lap)
    aux[motion_row.TIME] += dt
    _show(row, aux)
    aux[motion_row.TRAVELLED] += abs(row[board_row.SPEED]) * dt


@njit
def motion_reset(row, aux, u, z, inclination, moving):
    """Reset to path parameter `u`, board centre `z` m up, tilted by `inclination` rad.

    `moving` True: already at the law's speed; False: from rest. A path that had become an arc is the original path
    again.
    """
    if aux[motion_row.CHANGED] > 0.0:
        aux[motion_row.SPEED + speed_row.SWITCH] = math.inf
    for i in range(motion_row.CHANGE_TIME):
        aux[i] = 0.0
    row[board_row.Z], row[board_row.INCLINATION], row[board_row.U] = z, inclination, u
    if moving:
        aux[motion_row.LAW_SPEED] = speed_nominal(
            int(aux[motion_row.SPEED_KIND]), aux[motion_row.SPEED : motion_row.SPEED + speed_row.DIM], 0.0
        )
    _show(row, aux)


@njit
def motion_step(row, aux, dt, stream):
    """Advance the board by `dt` s (meant for 0.002 to 0.02). `stream` is drawn from only by a perturbed speed law."""
    kind, params = int(aux[motion_row.SPEED_KIND]), aux[motion_row.SPEED : motion_row.SPEED + speed_row.DIM]
    _advance(
        row,
        aux,
        dt,
        speed_law(kind, params, aux[motion_row.ETA : motion_row.ETA + 1], aux[motion_row.TIME] + dt, dt, stream),
    )


@njit
def motion_future(row, aux, dt, n, out):
    """Write the next `n` board rows, `dt` s apart, to `out` (>= n, 8): the critic's privileged information.

    No randomness: the speed law's OU factor stays what it is. `row` is not changed; `aux` is restored before returning.
    """
    kind, params = int(aux[motion_row.SPEED_KIND]), aux[motion_row.SPEED : motion_row.SPEED + speed_row.DIM]
    saved = aux[: motion_row.CHANGE_TIME].copy()
    switch, factor = aux[motion_row.SPEED + speed_row.SWITCH], math.exp(aux[motion_row.ETA])
    for k in range(n):
        for i in range(board_row.DIM):
            out[k, i] = row[i] if k == 0 else out[k - 1, i]
        _advance(out[k], aux, dt, speed_nominal(kind, params, aux[motion_row.TIME] + dt) * factor)
    aux[: motion_row.CHANGE_TIME] = saved
    aux[motion_row.SPEED + speed_row.SWITCH] = switch


def motion_aux(
    path_kind: int,
    path: np.ndarray,
    speed_kind: int,
    speed: np.ndarray,
    *,
    change_time: float = math.inf,
    change_length: float = math.inf,
    arc_radius: float = 0.0,
    response: float = 0.0,
    damping: float = 1.0,
    accel_limit: float = math.inf,
) -> np.ndarray:
    """An aux row ((motion_row.DIM,)) of one board; call `motion_reset` next. Raises ValueError.

    `change_time` (s) or `change_length` (m), whichever comes first, turns the path into the tangent arc of `arc_radius`
    (m, positive to the left; paper's Hard-II).
    """
    if path.shape != (path_row.DIM,) or speed.shape != (speed_row.DIM,):
        raise ValueError(
            f"need a path row ({path_row.DIM},) and a speed row ({speed_row.DIM},), not {path.shape} and {speed.shape}"
        )
    if math.isfinite(min(change_time, change_length)) and abs(arc_radius) < 0.1:
        raise ValueError(f"a change of path needs an arc radius of at least 0.1 m, not {arc_radius}")
    if not (accel_limit > 0.0 and response >= 0.0 and damping > 0.0):
        raise ValueError(f"accel_limit, damping must be > 0 and response >= 0: {accel_limit, damping, response}")
    aux = np.zeros(motion_row.DIM)
    aux[motion_row.CHANGE_TIME], aux[motion_row.CHANGE_LENGTH], aux[motion_row.ARC_RADIUS] = (
        change_time,
        change_length,
        arc_radius,
    )
    aux[motion_row.RESPONSE], aux[motion_row.DAMPING], aux[motion_row.ACCEL_LIMIT] = response, damping, accel_limit
    aux[motion_row.PATH_KIND], aux[motion_row.SPEED_KIND] = path_kind, speed_kind
    aux[motion_row.SPEED : motion_row.SPEED + speed_row.DIM], aux[motion_row.PATH : motion_row.PATH + path_row.DIM] = (
        speed,
        path,
    )
    return aux
