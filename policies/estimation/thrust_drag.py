"""Thrust gain (achieved over asked thrust) and drag, estimated in flight from velocity and attitude.

Mass and thrust-to-weight are known to +-15 % (paper). The measured specific force along the body's z axis is
regressed on the asked thrust after the motors' lag, with exponential forgetting and a prior at 1. Drag is
less certain. Thrust has no component across the body's z axis, so there the force is regressed on the velocity, with a
longer memory and a prior at the airframe's drag. Wind along the path counts as drag, which suits feedforward.
"""

from __future__ import annotations

import math

from kernel.clip import clip
from kernel.jit import njit
from policies.estimation import thrust_row

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
    row[thrust_row.GAIN], row[thrust_row.LAGGED] = 1.0, gravity


@njit
def gain_update(row, vx, vy, vz, zx, zy, zz, asked, dt, lag, drag, gravity):
    """One control step of thrust_row `row`: returns the gain (achieved over asked thrust).

    `v` m/s and body z axis `z` (world) now; `asked`: the thrust asked over the last `dt` s, m/s^2; `lag` s of thrust;
    `drag` 1/s, prior; row[thrust_row.DRAG] is the estimate. A tick with a number that is not finite changes nothing.
    """
    if not (math.isfinite(vx + vy + vz + zx + zy + zz + asked)) or dt <= 0.0:
        return row[thrust_row.GAIN]
    keep = math.exp(-dt / lag)
    # Mean of the lagged thrust over the tick, which is what the change of velocity shows.
    mean = asked + (row[thrust_row.LAGGED] - asked) * (1.0 - keep) * lag / dt
    row[thrust_row.LAGGED] = asked + (row[thrust_row.LAGGED] - asked) * keep
    if row[thrust_row.STARTED] > 0.0:
        mx, my, mz = (
            0.5 * (zx + row[thrust_row.Z]),
            0.5 * (zy + row[thrust_row.Z + 1]),
            0.5 * (zz + row[thrust_row.Z + 2]),
        )
        fx, fy, fz = (
            (vx - row[thrust_row.V]) / dt,
            (vy - row[thrust_row.V + 1]) / dt,
            (vz - row[thrust_row.V + 2]) / dt + gravity,
        )
        # Halfway, as the noise of the ends is in the difference too.
        ux, uy, uz = (
            0.5 * (vx + row[thrust_row.V]),
            0.5 * (vy + row[thrust_row.V + 1]),
            0.5 * (vz + row[thrust_row.V + 2]),
        )
        lift, rise = fx * mx + fy * my + fz * mz, ux * mx + uy * my + uz * mz
        forget = math.exp(-dt / _DRAG_MEMORY)
        row[thrust_row.VV] = forget * row[thrust_row.VV] + (ux * ux + uy * uy + uz * uz - rise * rise) * dt
        row[thrust_row.FV] = forget * row[thrust_row.FV] - (fx * ux + fy * uy + fz * uz - lift * rise) * dt
        found = (row[thrust_row.FV] + drag * _DRAG_PRIOR) / (row[thrust_row.VV] + _DRAG_PRIOR)
        row[thrust_row.DRAG] = clip(found, 0.0, _DRAG_MOST)
        forget = math.exp(-dt / _MEMORY)
        row[thrust_row.UU] = forget * row[thrust_row.UU] + mean * mean * dt
        row[thrust_row.SU] = forget * row[thrust_row.SU] + (lift + row[thrust_row.DRAG] * rise) * mean * dt
        prior = gravity * gravity * _PRIOR
        row[thrust_row.GAIN] = clip((row[thrust_row.SU] + prior) / (row[thrust_row.UU] + prior), _LOW, _HIGH)
    else:
        row[thrust_row.DRAG] = drag
    row[thrust_row.STARTED] = 1.0
    row[thrust_row.V], row[thrust_row.V + 1], row[thrust_row.V + 2] = vx, vy, vz
    row[thrust_row.Z], row[thrust_row.Z + 1], row[thrust_row.Z + 2] = zx, zy, zz
    return row[thrust_row.GAIN]
