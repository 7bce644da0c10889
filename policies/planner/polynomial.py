"""Motions of the perch: per axis a polynomial of order six between two states, with reduced jerk at contact."""

from __future__ import annotations

from kernel.jit import njit

COEFFICIENTS = 7  # per axis, lowest power first; a motion is a (3 * COEFFICIENTS,) row


@njit
def fit_axis(p0, v0, a0, p1, v1, a1, duration, flatten, out, at):
    """Coefficients into `out[at:at+7]` from (p0, v0, a0) at 0 to (p1, v1, a1) at `duration` s.

    `flatten` in 0..1 is the share of the quintic's terminal jerk that the sixth coefficient takes away.
    """
    t = duration
    dp = p1 - p0 - v0 * t - 0.5 * a0 * t * t
    dv = v1 - v0 - a0 * t
    da = a1 - a0
    t2, t3 = t * t, t * t * t
    c3 = (10.0 * dp - 4.0 * dv * t + 0.5 * da * t2) / t3
    c4 = (-15.0 * dp + 7.0 * dv * t - da * t2) / (t3 * t)
    c5 = (6.0 * dp - 3.0 * dv * t + 0.5 * da * t2) / (t3 * t2)
    jerk = 6.0 * c3 + 24.0 * c4 * t + 60.0 * c5 * t2
    # t^3 (t - T)^3 vanishes with its first two derivatives at both ends; its third is 6 T^3 at T.
    c6 = -flatten * jerk / (6.0 * t3)
    out[at], out[at + 1], out[at + 2] = p0, v0, 0.5 * a0
    out[at + 3] = c3 - c6 * t3
    out[at + 4] = c4 + 3.0 * c6 * t2
    out[at + 5] = c5 - 3.0 * c6 * t
    out[at + 6] = c6


@njit
def position(c, at, t):
    """Position of an axis at `t` s."""
    return c[at] + t * (
        c[at + 1] + t * (c[at + 2] + t * (c[at + 3] + t * (c[at + 4] + t * (c[at + 5] + t * c[at + 6]))))
    )


@njit
def velocity(c, at, t):
    """Velocity of an axis at `t` s."""
    return c[at + 1] + t * (
        2.0 * c[at + 2] + t * (3.0 * c[at + 3] + t * (4.0 * c[at + 4] + t * (5.0 * c[at + 5] + t * 6.0 * c[at + 6])))
    )


@njit
def acceleration(c, at, t):
    """Acceleration of an axis at `t` s."""
    return 2.0 * c[at + 2] + t * (
        6.0 * c[at + 3] + t * (12.0 * c[at + 4] + t * (20.0 * c[at + 5] + t * 30.0 * c[at + 6]))
    )


@njit
def jerk(c, at, t):
    """Jerk of an axis at `t` s."""
    return 6.0 * c[at + 3] + t * (24.0 * c[at + 4] + t * (60.0 * c[at + 5] + t * 120.0 * c[at + 6]))
