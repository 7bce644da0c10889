"""The random closed B-spline of the paper (appendix "Trajectory Definitions": generation, curvature check, shrinking).

The circular low-pass filter, which the paper leaves open, is the binomial one: r_i <- (r_{i-1} + 2 r_i + r_{i+1}) / 4.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import path_row
from kernel.jit import njit
from kernel.random import uniform

TURN_RATE_LIMIT = 1.2  # rad/s, paper
RADIUS_MIN, RADIUS_MAX = 1.0, 12.0  # m, paper
SPEED_FLOOR = 0.1  # m/s, the paper's epsilon
_SAMPLES = 16  # a segment
_BISECTIONS = 10


@njit(inline="always")
def _places(i, count):
    """Where segment i's four control points stand in a path row (remainders would cost more than the rest)."""
    return (
        path_row.CONTROL + 2 * i,
        path_row.CONTROL + 2 * (i + 1 if i + 1 < count else i + 1 - count),
        path_row.CONTROL + 2 * (i + 2 if i + 2 < count else i + 2 - count),
        path_row.CONTROL + 2 * (i + 3 if i + 3 < count else i + 3 - count),
    )


@njit
def spline_eval(params, u):
    """(x, y, dx, dy, ddx, ddy) of the closed spline in the path frame; u in knots, any real number."""
    count = int(params[path_row.COUNT])
    k = math.floor(u)
    t = u - k
    a, b, c, d = _places(int(k) % count, count)
    s, t2 = 1.0 - t, t * t
    wa, wd = s * s * s / 6.0, t2 * t / 6.0
    wb, wc = 2.0 / 3.0 - t2 + 0.5 * t2 * t, 2.0 / 3.0 - s * s + 0.5 * s * s * s
    va, vd = -0.5 * s * s, 0.5 * t2
    vb, vc = 1.5 * t2 - 2.0 * t, 2.0 * s - 1.5 * s * s
    ab, ac = 3.0 * t - 2.0, 3.0 * s - 2.0
    return (
        wa * params[a] + wb * params[b] + wc * params[c] + wd * params[d],
        wa * params[a + 1] + wb * params[b + 1] + wc * params[c + 1] + wd * params[d + 1],
        va * params[a] + vb * params[b] + vc * params[c] + vd * params[d],
        va * params[a + 1] + vb * params[b + 1] + vc * params[c + 1] + vd * params[d + 1],
        s * params[a] + ab * params[b] + ac * params[c] + t * params[d],
        s * params[a + 1] + ab * params[b + 1] + ac * params[c + 1] + t * params[d + 1],
    )


@njit
def _segment(params, i):
    """Coefficients of segment i's first derivative, dx = a + b t + c t^2 and dy alike: (ax, bx, cx, ay, by, cy)."""
    a, b, c, d = _places(i, int(params[path_row.COUNT]))
    return (
        0.5 * (params[c] - params[a]),
        params[a] - 2.0 * params[b] + params[c],
        0.5 * (params[d] - params[a]) + 1.5 * (params[b] - params[c]),
        0.5 * (params[c + 1] - params[a + 1]),
        params[a + 1] - 2.0 * params[b + 1] + params[c + 1],
        0.5 * (params[d + 1] - params[a + 1]) + 1.5 * (params[b + 1] - params[c + 1]),
    )


@njit(inline="always")
def _bend(g, t):
    """Squared curvature (1/m^2) at t of the segment with coefficients g."""
    dx, dy = g[0] + t * (g[1] + t * g[2]), g[3] + t * (g[4] + t * g[5])
    squared = dx * dx + dy * dy
    cross = dx * (g[4] + 2.0 * t * g[5]) - dy * (g[1] + 2.0 * t * g[2])
    return cross * cross / max(squared * squared * squared, 1e-30)


@njit
def _peak(g, low, high):
    """Largest squared curvature of segment g within [low, high], which holds one maximum (ternary search)."""
    for _ in range(12):
        third = (high - low) / 3.0
        if _bend(g, low + third) < _bend(g, high - third):
            low += third
        else:
            high -= third
    return _bend(g, 0.5 * (low + high))


@njit
def max_curvature(params, enough=math.inf):
    """Largest |curvature| (1/m) of the closed spline in a path row; stops early once it exceeds `enough`.

    Curvature is continuous over knots, so a maximum is either inside a segment, where it is refined, or at a knot.
    """
    limit = enough * enough
    best = 0.0
    step = 1.0 / _SAMPLES
    for i in range(int(params[path_row.COUNT])):
        g = _segment(params, i)
        before, here = 0.0, _bend(g, 0.0)
        for k in range(_SAMPLES + 1):
            after = _bend(g, (k + 1) * step) if k < _SAMPLES else 0.0
            if here >= before and here >= after and here > 0.7 * best:
                best = max(best, here, _peak(g, max(0.0, (k - 1) * step), min(1.0, (k + 1) * step)))
            before, here = here, after
        if best > limit:
            break
    return math.sqrt(best)


@njit
def _place(params, radii, mean, alpha):
    """Write control points for radii mean + alpha (radii - mean), read from the work area `radii` (count,)."""
    count = int(params[path_row.COUNT])
    for i in range(count):
        angle = 2.0 * math.pi * i / count
        r = mean + alpha * (radii[i] - mean)
        params[path_row.CONTROL + 2 * i] = r * math.cos(angle)
        params[path_row.CONTROL + 2 * i + 1] = r * math.sin(angle)


@njit
def random_spline(stream, params, v_des, count=12, r_min=RADIUS_MIN, r_max=RADIUS_MAX, turn_rate_limit=TURN_RATE_LIMIT):
    """Draw a closed spline into a path row: COUNT and control points in place; origin and heading are left alone.

    `stream`: (1,) uint64. Curvature is kept <= turn_rate_limit / max(v_des, 0.1 m/s) by shrinking radial deviations
    with a factor alpha found by bisection, which is returned (1: unchanged). If even the circle (alpha 0) is too tight,
    which takes fast boards and small radii, it is widened until it is not: the paper does not cover that.
    """
    limit = turn_rate_limit / max(v_des, SPEED_FLOOR)
    params[path_row.COUNT] = count
    radii = np.empty(count)
    mean = 0.0
    for i in range(count):
        radii[i] = uniform(stream, r_min, r_max)
        mean += radii[i] / count
    first, last = radii[0], radii[count - 1]
    before = last
    for i in range(count):
        here = radii[i]
        after = first if i == count - 1 else radii[i + 1]
        radii[i] = 0.25 * (before + 2.0 * here + after)
        before = here
    _place(params, radii, mean, 1.0)
    if max_curvature(params, limit) <= limit:
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        alpha = 0.5 * (low + high)
        _place(params, radii, mean, alpha)
        if max_curvature(params, limit) <= limit:
            low = alpha
        else:
            high = alpha
    _place(params, radii, mean, low)
    if low == 0.0:
        _place(params, radii, max(mean, mean * max_curvature(params) / limit), 0.0)
    return low
