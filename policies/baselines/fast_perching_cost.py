"""Fast-Perching's cost and gradient (Ji et al., "Real-time trajectory planning for aerial perching", IROS 2022).

The variables (VARIABLES,): a number that maps to the s a piece lasts, the way points, an angle that maps to the thrust
at contact, and the tangential velocity at contact along two directions of the board. The board goes on at its present
speed and turn rate; with the turn rate 0 it is the published method, which predicts straight on.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.jit import njit
from policies.baselines.min_snap import BOUNDARY, END, PIECES, SAMPLES, WAYPOINTS

_POINTS = PIECES - 1
X_TIME, X_WAYPOINTS, X_FORCE, X_SKID = 0, 1, 1 + 3 * _POINTS, 2 + 3 * _POINTS
VARIABLES = X_SKID + 2

# Settings row: limits (SI), the body against the board (m, m/s), gravity.
(SPEED_MAX, THRUST_MIN, THRUST_MAX, RATE_MAX, ROBOT_L, ROBOT_R, BOARD_R, CLOSING, FLOOR, GRAVITY) = range(10)

_RHO_TIME, _RHO_SKID = 1e5, 1e5
_W_FLOOR, _W_SPEED, _W_THRUST, _W_RATE, _W_BOARD = 1e7, 1e3, 1e4, 1e5, 1e6
_MU = 0.01  # half-width of what smooths the penalties


@njit
def piece_seconds(t):
    """Seconds a piece lasts and their derivative, for any real `t`."""
    if t > 0.0:
        return (0.5 * t + 1.0) * t + 1.0, t + 1.0
    d = (0.5 * t - 1.0) * t + 1.0
    return 1.0 / d, (1.0 - t) / (d * d)


@njit
def piece_variable(seconds):
    """Inverse of `piece_seconds`."""
    if seconds > 1.0:
        return math.sqrt(2.0 * seconds - 1.0) - 1.0
    return 1.0 - math.sqrt(2.0 / seconds - 1.0)


@njit
def smooth_excess(x):
    """max(x, 0) rounded off below _MU, and its derivative."""
    if x <= 0.0:
        return 0.0, 0.0
    if x >= _MU:
        return x - 0.5 * _MU, 1.0
    r = x / _MU
    return (_MU - 0.5 * x) * r * r * r, r * r * (3.0 - 2.0 * r)


@njit
def smooth_step(x):
    """0 below -_MU, 1 above _MU, and its derivative."""
    if x <= -_MU:
        return 0.0, 0.0
    if x >= _MU:
        return 1.0, 0.0
    r = 0.5 * (x + _MU) / _MU
    return r * r * (3.0 - 2.0 * r), 3.0 * r * (1.0 - r) / _MU


@njit
def board_at(board, t, out):
    """Position, velocity, normal and the two tangents of `board` ((8,) board row) in `t` s, into `out` (15,)."""
    h0, w = board[3], board[5]
    h = h0 + w * t
    c, s = math.cos(h), math.sin(h)
    if abs(w) < 1e-6:
        dx, dy = board[4] * t * c, board[4] * t * s
    else:
        r = board[4] / w
        dx, dy = r * (s - math.sin(h0)), r * (math.cos(h0) - c)
    out[0], out[1], out[2] = board[0] + dx, board[1] + dy, board[2]
    out[3], out[4], out[5] = board[4] * c, board[4] * s, 0.0
    ci, si = math.cos(board[6]), math.sin(board[6])
    out[6], out[7], out[8] = -si * c, -si * s, ci
    out[9], out[10], out[11] = -s, c, 0.0
    out[12], out[13], out[14] = ci * c, ci * s, si


@njit
def fill_boundary(x, start, board, settings, boundary, carried):
    """The boundary ((3, BOUNDARY)) of variables `x`; returns the s of a piece.

    `start` ((4, 3)): position, velocity, acceleration, jerk now. `carried` (15,): the board at the end.
    """
    h = piece_seconds(x[X_TIME])[0]
    board_at(board, PIECES * h, carried)
    middle = 0.5 * (settings[THRUST_MIN] + settings[THRUST_MAX])
    half = 0.5 * (settings[THRUST_MAX] - settings[THRUST_MIN])
    thrust = middle + half * math.sin(x[X_FORCE])
    for i in range(3):
        n = carried[6 + i]
        for d in range(4):
            boundary[i, d] = start[d, i] * h**d
        for k in range(_POINTS):
            boundary[i, WAYPOINTS + k] = x[X_WAYPOINTS + 3 * k + i]
        boundary[i, END] = carried[i] + settings[ROBOT_L] * n
        skid = x[X_SKID] * carried[9 + i] + x[X_SKID + 1] * carried[12 + i]
        boundary[i, END + 1] = (carried[3 + i] - settings[CLOSING] * n + skid) * h
        boundary[i, END + 2] = (thrust * n - (settings[GRAVITY] if i == 2 else 0.0)) * h * h
        boundary[i, END + 3] = 0.0
    return h


@njit
def sample_cost(state, now, settings, gradient):
    """Penalty at one sample, whose `gradient` is added to zeros; returns (cost, derivative by the board's time).

    `state`, `gradient` ((4, 3)): position, velocity, acceleration, jerk; `now` (15 + 1,): the board then, and its turn
    rate.
    """
    p, v, a, j = state[0], state[1], state[2], state[3]
    gp, gv, ga, gj = gradient[0], gradient[1], gradient[2], gradient[3]
    cost, by_time = 0.0, 0.0
    value, slope = smooth_excess(settings[FLOOR] - p[2])
    cost += _W_FLOOR * value
    gp[2] -= _W_FLOOR * slope
    value, slope = smooth_excess(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - settings[SPEED_MAX] ** 2)
    cost += _W_SPEED * value
    for i in range(3):
        gv[i] += _W_SPEED * slope * 2.0 * v[i]
    fx, fy, fz = a[0], a[1], a[2] + settings[GRAVITY]
    square = fx * fx + fy * fy + fz * fz
    over, s_over = smooth_excess(square - settings[THRUST_MAX] ** 2)
    under, s_under = smooth_excess(settings[THRUST_MIN] ** 2 - square)
    cost += _W_THRUST * (over + under)
    pull = _W_THRUST * 2.0 * (s_over - s_under)
    ga[0] += pull * fx
    ga[1] += pull * fy
    ga[2] += pull * fz
    size = max(1e-6, math.sqrt(square))
    zx, zy, zz = fx / size, fy / size, fz / size
    along = zx * j[0] + zy * j[1] + zz * j[2]
    rx, ry, rz = (j[0] - along * zx) / size, (j[1] - along * zy) / size, (j[2] - along * zz) / size
    value, slope = smooth_excess(rx * rx + ry * ry + rz * rz - settings[RATE_MAX] ** 2)
    cost += _W_RATE * value
    if slope > 0.0:
        # |r|^2 = (|j|^2 - along^2) / size^2; r stands upright on z.
        w = _W_RATE * slope * 2.0
        rate2 = rx * rx + ry * ry + rz * rz
        gj[0] += w * rx / size
        gj[1] += w * ry / size
        gj[2] += w * rz / size
        ga[0] -= w * (along * rx + rate2 * fx) / (size * size)
        ga[1] -= w * (along * ry + rate2 * fy) / (size * size)
        ga[2] -= w * (along * rz + rate2 * fz) / (size * size)
    dx, dy, dz = p[0] - now[0], p[1] - now[1], p[2] - now[2]
    reach = settings[BOARD_R] + settings[ROBOT_R]
    gate, s_gate = smooth_step(1.0 - (dx * dx + dy * dy + dz * dz) / (reach * reach))
    if gate > 0.0:
        nx, ny, nz = now[6], now[7], now[8]
        upright = min(1.0, max(-1.0, nx * zx + ny * zy + nz * zz))
        lean = math.sqrt(max(1e-12, 1.0 - upright * upright))
        depth = settings[ROBOT_L] - 0.005
        inside = -(nx * dx + ny * dy + nz * dz) + depth * upright + settings[ROBOT_R] * lean
        value, slope = smooth_excess(inside)
        cost += _W_BOARD * gate * value
        w, wg = _W_BOARD * gate * slope, -_W_BOARD * value * s_gate * 2.0 / (reach * reach)
        gpx, gpy, gpz = wg * dx - w * nx, wg * dy - w * ny, wg * dz - w * nz
        gp[0] += gpx
        gp[1] += gpy
        gp[2] += gpz
        tilt = w * (depth - settings[ROBOT_R] * upright / lean) / size
        ga[0] += tilt * (nx - upright * zx)
        ga[1] += tilt * (ny - upright * zy)
        ga[2] += tilt * (nz - upright * zz)
        # The board moves on and its normal turns about the vertical meanwhile.
        tx, ty = -now[15] * ny, now[15] * nx
        by_time -= gpx * now[3] + gpy * now[4] + gpz * now[5]
        by_time += -w * (tx * dx + ty * dy) + tilt * size * (tx * zx + ty * zy)
    return cost, by_time


@njit
def cost_and_gradient(x, start, board, settings, energy, sampled, by_sample, gradient):
    """Cost of variables `x` ((VARIABLES,)); fills `gradient`. Other shapes: `fill_boundary`, `min_snap.MinSnap`."""
    boundary, carried, now = np.zeros((3, BOUNDARY)), np.zeros(15), np.zeros(16)
    h = fill_boundary(x, start, board, settings, boundary, carried)
    now[15] = board[5]
    cost, by_h = _RHO_TIME * h, _RHO_TIME
    by_boundary = np.zeros((3, BOUNDARY))
    for i in range(3):
        for b in range(BOUNDARY):
            by_boundary[i] += (2.0 / h**7 * boundary[i, b]) * energy[b]
    snap = 0.5 * (by_boundary * boundary).sum()
    cost += snap
    by_h -= 7.0 * snap / h
    samples = PIECES * (SAMPLES + 1)
    states, by_states = np.zeros((4, 3, samples)), np.zeros((4, 3, samples))
    for d in range(4):
        for i in range(3):
            for b in range(BOUNDARY):
                value = boundary[i, b] / h**d
                for m in range(samples):
                    states[d, i, m] += value * sampled[d, b, m]
    for m in range(samples):
        within = m % (SAMPLES + 1)
        weight = (0.5 if within == 0 or within == SAMPLES else 1.0) / SAMPLES
        at = m // (SAMPLES + 1) + within / SAMPLES
        board_at(board, at * h, now)
        value, by_time = sample_cost(states[:, :, m], now, settings, by_states[:, :, m])
        cost += weight * h * value
        by_h += weight * (value + h * by_time * at)
        for d in range(4):
            for i in range(3):
                g = weight * h * by_states[d, i, m]
                by_h -= g * d * states[d, i, m] / h
                if g != 0.0:
                    g /= h**d
                    for b in range(BOUNDARY):
                        by_boundary[i, b] += g * by_sample[d, m, b]
    by_h += _through_boundary(x, start, board, settings, carried, boundary, by_boundary, h, gradient)
    for k in range(2):
        cost += _RHO_SKID * x[X_SKID + k] * x[X_SKID + k]
        gradient[X_SKID + k] += 2.0 * _RHO_SKID * x[X_SKID + k]
    gradient[X_TIME] = by_h * piece_seconds(x[X_TIME])[1]
    return cost


@njit
def _through_boundary(x, start, board, settings, carried, boundary, by_boundary, h, gradient):
    """Gradients by way points, force and skid from those by the boundary; returns the part by the s of a piece."""
    half = 0.5 * (settings[THRUST_MAX] - settings[THRUST_MIN])
    by_h, w = 0.0, board[5]
    gradient[:] = 0.0
    for i in range(3):
        for d in range(1, 4):
            by_h += by_boundary[i, d] * start[d, i] * d * h ** (d - 1)
        for k in range(_POINTS):
            gradient[X_WAYPOINTS + 3 * k + i] = by_boundary[i, WAYPOINTS + k]
        gp, gv, ga = by_boundary[i, END], by_boundary[i, END + 1], by_boundary[i, END + 2]
        gradient[X_FORCE] += ga * half * math.cos(x[X_FORCE]) * carried[6 + i] * h * h
        gradient[X_SKID] += gv * carried[9 + i] * h
        gradient[X_SKID + 1] += gv * carried[12 + i] * h
        by_h += gv * boundary[i, END + 1] / h + 2.0 * ga * boundary[i, END + 2] / h + gp * PIECES * carried[3 + i]
    # Later contact finds the board further on its circle: everything fixed to it has turned about the vertical.
    for i in range(2):
        turn, other = (-w, 1) if i == 0 else (w, 0)
        by_h += PIECES * by_boundary[i, END] * turn * settings[ROBOT_L] * carried[6 + other]
        by_h += PIECES * by_boundary[i, END + 1] * turn * boundary[other, END + 1]
        by_h += PIECES * by_boundary[i, END + 2] * turn * boundary[other, END + 2]
    return by_h
