"""How much thrust the vehicle gives for what is asked, and its drag, found online from its own velocity and attitude.

Mass and thrust-to-weight are never quite known (paper: +-15 %). The measured specific force along the body's z axis is
regressed on the asked thrust after the motors' lag, with exponential forgetting and a prior at 1. Drag is known even
less. Thrust has no part across the body's z axis: there the force is regressed on the velocity, with a longer memory
and a prior at what the airframe's file says. Wind along the way counts as drag, which is what feedforward wants.
"""

from __future__ import annotations

import math

from kernel.jit import njit

# Indices of a thrust-gain row.
G_GAIN, G_LAGGED, G_UU, G_SU, G_STARTED = 0, 1, 2, 3, 4
G_V, G_Z = 5, 8  # velocity (3) and body z axis (3) of the tick before
G_DRAG, G_VV, G_FV = 11, 12, 13
GAIN_DIM = 14

_MEMORY = 0.6  # s, of the exponential forgetting
_PRIOR = 0.02  # s, worth of hovering that the prior counts for
_LOW, _HIGH = 0.6, 1.5
_DRAG_MEMORY = 1.5  # s
_DRAG_PRIOR = 0.5  # m^2/s, what the prior counts for: a second at 0.7 m/s
_DRAG_MOST = 1.0  # 1/s


@njit
def gain_reset(row, gravity):
    """Start from a gain of 1, with the motors at hover."""
    row[:] = 0.0
    row[G_GAIN], row[G_LAGGED] = 1.0, gravity


@njit
def gain_update(row, vx, vy, vz, zx, zy, zz, asked, dt, lag, drag, gravity):
    """One control tick: returns the gain (achieved over asked thrust).

    `v` m/s and body z axis `z` (world) now; `asked`: the thrust asked over the last `dt` s, m/s^2; `lag` s of thrust;
    `drag` 1/s, expected; row[G_DRAG] is what was found. A tick whose numbers are not finite changes nothing.
    """
    if not (math.isfinite(vx + vy + vz + zx + zy + zz + asked)) or dt <= 0.0:
        return row[G_GAIN]
    keep = math.exp(-dt / lag)
    # Mean of the lagged thrust over the tick, which is what the change of velocity shows.
    mean = asked + (row[G_LAGGED] - asked) * (1.0 - keep) * lag / dt
    row[G_LAGGED] = asked + (row[G_LAGGED] - asked) * keep
    if row[G_STARTED] > 0.0:
        mx, my, mz = 0.5 * (zx + row[G_Z]), 0.5 * (zy + row[G_Z + 1]), 0.5 * (zz + row[G_Z + 2])
        fx, fy, fz = (vx - row[G_V]) / dt, (vy - row[G_V + 1]) / dt, (vz - row[G_V + 2]) / dt + gravity
        # Halfway, as the noise of the ends is in the difference too.
        ux, uy, uz = 0.5 * (vx + row[G_V]), 0.5 * (vy + row[G_V + 1]), 0.5 * (vz + row[G_V + 2])
        lift, rise = fx * mx + fy * my + fz * mz, ux * mx + uy * my + uz * mz
        forget = math.exp(-dt / _DRAG_MEMORY)
        row[G_VV] = forget * row[G_VV] + (ux * ux + uy * uy + uz * uz - rise * rise) * dt
        row[G_FV] = forget * row[G_FV] - (fx * ux + fy * uy + fz * uz - lift * rise) * dt
        row[G_DRAG] = min(_DRAG_MOST, max(0.0, (row[G_FV] + drag * _DRAG_PRIOR) / (row[G_VV] + _DRAG_PRIOR)))
        forget = math.exp(-dt / _MEMORY)
        row[G_UU] = forget * row[G_UU] + mean * mean * dt
        row[G_SU] = forget * row[G_SU] + (lift + row[G_DRAG] * rise) * mean * dt
        prior = gravity * gravity * _PRIOR
        row[G_GAIN] = min(_HIGH, max(_LOW, (row[G_SU] + prior) / (row[G_UU] + prior)))
    else:
        row[G_DRAG] = drag
    row[G_STARTED] = 1.0
    row[G_V], row[G_V + 1], row[G_V + 2] = vx, vy, vz
    row[G_Z], row[G_Z + 1], row[G_Z + 2] = zx, zy, zz
    return row[G_GAIN]
