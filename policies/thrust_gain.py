"""How much thrust the vehicle gives for what is asked: an online estimate from its own velocity and attitude.

Mass and thrust-to-weight are never quite known (paper: +-15 %). The measured specific force along the body's z axis is
regressed on the asked thrust after the motors' lag, with exponential forgetting and a prior at 1.
"""

from __future__ import annotations

import math

from kernel import njit

# Indices of a thrust-gain row.
G_GAIN, G_LAGGED, G_UU, G_SU, G_STARTED = 0, 1, 2, 3, 4
G_V, G_Z = 5, 8  # velocity (3) and body z axis (3) of the tick before
GAIN_DIM = 11

_MEMORY = 0.6  # s, of the exponential forgetting
_PRIOR = 0.02  # s, worth of hovering that the prior counts for
_LOW, _HIGH = 0.6, 1.5


@njit
def gain_reset(row, gravity):
    """Start from a gain of 1, with the motors at hover."""
    row[:] = 0.0
    row[G_GAIN], row[G_LAGGED] = 1.0, gravity


@njit
def gain_update(row, vx, vy, vz, zx, zy, zz, asked, dt, lag, drag, gravity):
    """One control tick: returns the gain (achieved over asked thrust).

    `v` m/s and body z axis `z` (world) now; `asked`: the thrust asked over the last `dt` s, m/s^2; `lag` s of thrust;
    `drag` 1/s. A tick whose numbers are not finite changes nothing.
    """
    if not (math.isfinite(vx + vy + vz + zx + zy + zz + asked)) or dt <= 0.0:
        return row[G_GAIN]
    keep = math.exp(-dt / lag)
    # Mean of the lagged thrust over the tick, which is what the change of velocity shows.
    mean = asked + (row[G_LAGGED] - asked) * (1.0 - keep) * lag / dt
    row[G_LAGGED] = asked + (row[G_LAGGED] - asked) * keep
    if row[G_STARTED] > 0.0:
        mx, my, mz = 0.5 * (zx + row[G_Z]), 0.5 * (zy + row[G_Z + 1]), 0.5 * (zz + row[G_Z + 2])
        fx = (vx - row[G_V]) / dt + drag * vx
        fy = (vy - row[G_V + 1]) / dt + drag * vy
        fz = (vz - row[G_V + 2]) / dt + drag * vz + gravity
        forget = math.exp(-dt / _MEMORY)
        row[G_UU] = forget * row[G_UU] + mean * mean * dt
        row[G_SU] = forget * row[G_SU] + (fx * mx + fy * my + fz * mz) * mean * dt
        prior = gravity * gravity * _PRIOR
        row[G_GAIN] = min(_HIGH, max(_LOW, (row[G_SU] + prior) / (row[G_UU] + prior)))
    row[G_STARTED] = 1.0
    row[G_V], row[G_V + 1], row[G_V + 2] = vx, vy, vz
    row[G_Z], row[G_Z + 1], row[G_Z + 2] = zx, zy, zz
    return row[G_GAIN]
