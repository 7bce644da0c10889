"""Fast-Perching's cost and gradient (Ji et al., "Real-time trajectory planning for aerial perching", IROS 2022).

The variables are those of `variables_row`. The board is predicted at its present speed and turn rate; with a turn rate
of 0 this is the published method, which predicts a straight line.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import board_row
from kernel.jit import njit
from policies.baselines import carried_row, variables_row
from policies.baselines.fast_perching_params import AT
from policies.baselines.min_snap import BOUNDARY, END, PIECES, SAMPLES, WAYPOINTS
from policies.baselines.smoothing import piece_seconds, smooth_excess, smooth_step

_POINTS = PIECES - 1
_RHO_TIME, _RHO_SKID = 1e5, 1e5
_W_FLOOR, _W_SPEED, _W_THRUST, _W_RATE, _W_BOARD = 1e7, 1e3, 1e4, 1e5, 1e6


@njit
def board_at(board, t, out):
    """`board` ((8,) board row) in `t` s, into `out` (carried_row.DIM,)."""
    h0, w = board[board_row.HEADING], board[board_row.TURN_RATE]
    h = h0 + w * t
    c, s = math.cos(h), math.sin(h)
    if abs(w) < 1e-6:
        dx, dy = board[board_row.SPEED] * t * c, board[board_row.SPEED] * t * s
    else:
        r = board[board_row.SPEED] / w
        dx, dy = r * (s - math.sin(h0)), r * (math.cos(h0) - c)
    position, velocity = out[carried_row.POSITION :], out[carried_row.VELOCITY :]
    position[0], position[1], position[2] = board[board_row.X] + dx, board[board_row.Y] + dy, board[board_row.Z]
    velocity[0], velocity[1], velocity[2] = board[board_row.SPEED] * c, board[board_row.SPEED] * s, 0.0
    ci, si = math.cos(board[board_row.INCLINATION]), math.sin(board[board_row.INCLINATION])
    normal, across, along = out[carried_row.NORMAL :], out[carried_row.ACROSS :], out[carried_row.ALONG :]
    normal[0], normal[1], normal[2] = -si * c, -si * s, ci
    across[0], across[1], across[2] = -s, c, 0.0
    along[0], along[1], along[2] = ci * c, ci * s, si
    out[carried_row.TURN] = w


@njit
def fill_boundary(x, start, board, settings, boundary, carried):
    """The boundary ((3, BOUNDARY)) of variables `x`; returns the s of a piece.

    `start` ((4, 3)): position, velocity, acceleration, jerk now. `carried` (carried_row.DIM,): the board at the end.
    """
    h = piece_seconds(x[variables_row.TIME])[0]
    board_at(board, PIECES * h, carried)
    middle = 0.5 * (settings[AT.thrust_min] + settings[AT.thrust_max])
    half = 0.5 * (settings[AT.thrust_max] - settings[AT.thrust_min])
    thrust = middle + half * math.sin(x[variables_row.FORCE])
    for i in range(3):
        n = carried[carried_row.NORMAL + i]
        for d in range(4):
            boundary[i, d] = start[d, i] * h**d
        for k in range(_POINTS):
            boundary[i, WAYPOINTS + k] = x[variables_row.WAYPOINTS + 3 * k + i]
        boundary[i, END] = carried[carried_row.POSITION + i] + settings[AT.contact_below] * n
        skid = (
            x[variables_row.SKID] * carried[carried_row.ACROSS + i]
            + x[variables_row.SKID + 1] * carried[carried_row.ALONG + i]
        )
        boundary[i, END + 1] = (carried[carried_row.VELOCITY + i] - settings[AT.closing] * n + skid) * h
        boundary[i, END + 2] = (thrust * n - (settings[AT.gravity] if i == 2 else 0.0)) * h * h
        boundary[i, END + 3] = 0.0
    return h


@njit
def sample_cost(state, now, settings, gradient):
    """Penalty at one sample, whose `gradient` is added to zeros; returns (cost, derivative by the board's time).

    `state`, `gradient` ((4, 3)): position, velocity, acceleration, jerk; `now` (carried_row.DIM,): the board
    then.
    """
    p, v, a, j = state[0], state[1], state[2], state[3]
    gp, gv, ga, gj = gradient[0], gradient[1], gradient[2], gradient[3]
    cost, by_time = 0.0, 0.0
    value, slope = smooth_excess(settings[AT.floor] - p[2])
    cost += _W_FLOOR * value
    gp[2] -= _W_FLOOR * slope
    value, slope = smooth_excess(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - settings[AT.speed_max] ** 2)
    cost += _W_SPEED * value
    for i in range(3):
        gv[i] += _W_SPEED * slope * 2.0 * v[i]
    fx, fy, fz = a[0], a[1], a[2] + settings[AT.gravity]
    square = fx * fx + fy * fy + fz * fz
    over, s_over = smooth_excess(square - settings[AT.thrust_max] ** 2)
    under, s_under = smooth_excess(settings[AT.thrust_min] ** 2 - square)
    cost += _W_THRUST * (over + under)
    pull = _W_THRUST * 2.0 * (s_over - s_under)
    ga[0] += pull * fx
    ga[1] += pull * fy
    ga[2] += pull * fz
    size = max(1e-6, math.sqrt(square))
    zx, zy, zz = fx / size, fy / size, fz / size
    along = zx * j[0] + zy * j[1] + zz * j[2]
    rx, ry, rz = (j[0] - along * zx) / size, (j[1] - along * zy) / size, (j[2] - along * zz) / size
    value, slope = smooth_excess(rx * rx + ry * ry + rz * rz - settings[AT.rate_max] ** 2)
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
    dx, dy, dz = (
        p[0] - now[carried_row.POSITION],
        p[1] - now[carried_row.POSITION + 1],
        p[2] - now[carried_row.POSITION + 2],
    )
    reach = settings[AT.board_radius] + settings[AT.contact_radius]
    near, s_near = smooth_step(1.0 - (dx * dx + dy * dy + dz * dz) / (reach * reach))
    if near > 0.0:
        nx, ny, nz = now[carried_row.NORMAL], now[carried_row.NORMAL + 1], now[carried_row.NORMAL + 2]
        upright = min(1.0, max(-1.0, nx * zx + ny * zy + nz * zz))
        lean = math.sqrt(max(1e-12, 1.0 - upright * upright))
        depth = settings[AT.contact_below] - 0.005
        inside = -(nx * dx + ny * dy + nz * dz) + depth * upright + settings[AT.contact_radius] * lean
        value, slope = smooth_excess(inside)
        cost += _W_BOARD * near * value
        w, wg = _W_BOARD * near * slope, -_W_BOARD * value * s_near * 2.0 / (reach * reach)
        gpx, gpy, gpz = wg * dx - w * nx, wg * dy - w * ny, wg * dz - w * nz
        gp[0] += gpx
        gp[1] += gpy
        gp[2] += gpz
        tilt = w * (depth - settings[AT.contact_radius] * upright / lean) / size
        ga[0] += tilt * (nx - upright * zx)
        ga[1] += tilt * (ny - upright * zy)
        ga[2] += tilt * (nz - upright * zz)
        # The board moves on and its normal turns about the vertical meanwhile.
        tx, ty = -now[carried_row.TURN] * ny, now[carried_row.TURN] * nx
        by_time -= (
            gpx * now[carried_row.VELOCITY] + gpy * now[carried_row.VELOCITY + 1] + gpz * now[carried_row.VELOCITY + 2]
        )
        by_time += -w * (tx * dx + ty * dy) + tilt * size * (tx * zx + ty * zy)
    return cost, by_time


@njit
def cost_and_gradient(x, start, board, settings, energy, sampled, by_sample, gradient):
    """Cost of variables `x` (variables_row.DIM,); fills `gradient`. Other shapes: `fill_boundary`, `MinSnap`."""
    boundary, carried, now = np.zeros((3, BOUNDARY)), np.zeros(carried_row.DIM), np.zeros(carried_row.DIM)
    h = fill_boundary(x, start, board, settings, boundary, carried)
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
        cost += _RHO_SKID * x[variables_row.SKID + k] * x[variables_row.SKID + k]
        gradient[variables_row.SKID + k] += 2.0 * _RHO_SKID * x[variables_row.SKID + k]
    gradient[variables_row.TIME] = by_h * piece_seconds(x[variables_row.TIME])[1]
    return cost


@njit
def _through_boundary(x, start, board, settings, carried, boundary, by_boundary, h, gradient):
    """Gradients by way points, force and skid from those by the boundary; returns the part by the s of a piece."""
    half = 0.5 * (settings[AT.thrust_max] - settings[AT.thrust_min])
    by_h, w = 0.0, board[board_row.TURN_RATE]
    gradient[:] = 0.0
    for i in range(3):
        for d in range(1, 4):
            by_h += by_boundary[i, d] * start[d, i] * d * h ** (d - 1)
        for k in range(_POINTS):
            gradient[variables_row.WAYPOINTS + 3 * k + i] = by_boundary[i, WAYPOINTS + k]
        gp, gv, ga = by_boundary[i, END], by_boundary[i, END + 1], by_boundary[i, END + 2]
        gradient[variables_row.FORCE] += (
            ga * half * math.cos(x[variables_row.FORCE]) * carried[carried_row.NORMAL + i] * h * h
        )
        gradient[variables_row.SKID] += gv * carried[carried_row.ACROSS + i] * h
        gradient[variables_row.SKID + 1] += gv * carried[carried_row.ALONG + i] * h
        by_h += (
            gv * boundary[i, END + 1] / h
            + 2.0 * ga * boundary[i, END + 2] / h
            + gp * PIECES * carried[carried_row.VELOCITY + i]
        )
    # Later contact finds the board further on its circle: everything fixed to it has turned about the vertical.
    for i in range(2):
        turn, other = (-w, 1) if i == 0 else (w, 0)
        by_h += PIECES * by_boundary[i, END] * turn * settings[AT.contact_below] * carried[carried_row.NORMAL + other]
        by_h += PIECES * by_boundary[i, END + 1] * turn * boundary[other, END + 1]
        by_h += PIECES * by_boundary[i, END + 2] * turn * boundary[other, END + 2]
    return by_h
