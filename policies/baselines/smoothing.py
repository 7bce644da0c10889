"""Smooth functions of Fast-Perching: durations that stay positive, and penalties with a continuous derivative."""

from __future__ import annotations

import math

from kernel.jit import njit

_MU = 0.01  # half-width of the rounded part of a penalty


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
