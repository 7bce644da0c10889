"""Many vehicles over one control period: the loop, mixer, motors and body of `rate_control.fly`, eight at a time.

Eight rows are copied side by side, one a column, so that a loop over columns becomes vector instructions. For that the
loop's body must contain no branch while it uses an array: Numba counts references to arrays, and it removes these
counts only from straight code, before LLVM looks for vectors. Branches are in functions of numbers. The motors' limits
take two fifths of the time and are left out where no vehicle of the eight reaches them. The numbers are bit for bit
those of `fly`.
"""

from __future__ import annotations

import numpy as np

from kernel.jit import njit, prange
from vehicle.quadrotor import airframe_row, command_row, order_row, state_row
from vehicle.quadrotor.dynamics import motor_lag, vehicle_step
from vehicle.quadrotor.mixer import mix_freely
from vehicle.quadrotor.rate_control import allocate, filter_coefficients, normalised_thrust, torques

LANES = 8

# Rows of a block's workspace after vehicles and airframes.
_PARAMS = state_row.DIM
_FILTERS = _PARAMS + airframe_row.DIM  # 8
_LAG = _FILTERS + 8  # 2
_SETPOINT = _LAG + 2  # 3, rad/s
_THRUST = _SETPOINT + 3  # 0..1
_TORQUE = _THRUST + 1  # 2, roll and pitch
_SATURATED = _TORQUE + 2
_ROWS = _SATURATED + 1


@njit(inline="always")
def _ask(work, k, order, at, params):
    for j in range(3):
        work[_SETPOINT + j, k] = order[at + command_row.RATE + j]
    work[_THRUST, k] = normalised_thrust(order[at + command_row.THRUST], params)


@njit(inline="always")
def _load(work, k, row, order, params, h):
    for j in range(state_row.DIM):
        work[j, k] = row[j]
    for j in range(airframe_row.DIM):
        work[_PARAMS + j, k] = params[j]
    c, lag = filter_coefficients(params, h), motor_lag(params, h)
    for j in range(8):
        work[_FILTERS + j, k] = c[j]
    work[_LAG, k], work[_LAG + 1, k] = lag
    _ask(work, k, order, order_row.OLDER, params)


@njit(inline="always")
def _command(work, k, h):
    """Rate loop and unlimited mixer of column k; a column whose motors saturate is marked."""
    p = work[_PARAMS:_FILTERS]
    f = _FILTERS
    c = (
        work[f, k],
        work[f + 1, k],
        work[f + 2, k],
        work[f + 3, k],
        work[f + 4, k],
        work[f + 5, k],
        work[f + 6, k],
        work[f + 7, k],
    )
    setpoint = (work[_SETPOINT, k], work[_SETPOINT + 1, k], work[_SETPOINT + 2, k])
    roll, pitch, yaw = torques(work, k, setpoint, p, c, h)
    work[_TORQUE, k], work[_TORQUE + 1, k] = roll, pitch
    u, work[_SATURATED, k] = mix_freely(
        roll, pitch, yaw, work[_THRUST, k], p[airframe_row.MIXER_ROLL_PITCH, k], p[airframe_row.MIXER_YAW, k]
    )
    (
        work[state_row.COMMAND, k],
        work[state_row.COMMAND + 1, k],
        work[state_row.COMMAND + 2, k],
        work[state_row.COMMAND + 3, k],
    ) = u
    work[state_row.HEADROOM_UP, k], work[state_row.HEADROOM_UP + 1, k], work[state_row.HEADROOM_UP + 2, k] = (
        1.0,
        1.0,
        1.0,
    )
    work[state_row.HEADROOM_DOWN, k], work[state_row.HEADROOM_DOWN + 1, k], work[state_row.HEADROOM_DOWN + 2, k] = (
        1.0,
        1.0,
        1.0,
    )


@njit(inline="always")
def _desaturate(work, k):
    torque = (work[_TORQUE, k], work[_TORQUE + 1, k], work[state_row.TORQUE_YAW, k])
    u = allocate(work, k, torque, work[_THRUST, k], work[_PARAMS:_FILTERS])
    (
        work[state_row.COMMAND, k],
        work[state_row.COMMAND + 1, k],
        work[state_row.COMMAND + 2, k],
        work[state_row.COMMAND + 3, k],
    ) = u


@njit(inline="always")
def _move(work, k, h):
    u = (
        work[state_row.COMMAND, k],
        work[state_row.COMMAND + 1, k],
        work[state_row.COMMAND + 2, k],
        work[state_row.COMMAND + 3, k],
    )
    vehicle_step(work, k, u, work[_PARAMS:_FILTERS], (work[_LAG, k], work[_LAG + 1, k]), h)


@njit
def fly_block(rows, orders, params, first, h, substeps):
    """Advance rows first .. first + LANES - 1 of (N, state_row.DIM) in place by `substeps` of `h` s, to the last row.

    `orders` (N, order_row.DIM), `params` (N, airframe_row.DIM).
    """
    work = np.empty((_ROWS, LANES))
    count = min(LANES, rows.shape[0] - first)
    for k in range(LANES):
        i = first + min(k, count - 1)  # a block that is not full flies its last vehicle several times
        _load(work, k, rows[i], orders[i], params[i], h)
    for step in range(substeps):
        for k in range(count):
            if step == orders[first + k, order_row.SINCE]:
                _ask(work, k, orders[first + k], order_row.NEWER, params[first + k])
        for k in range(LANES):
            _command(work, k, h)
        if work[_SATURATED].any():
            for k in range(LANES):
                _desaturate(work, k)
        for k in range(LANES):
            _move(work, k, h)
    for k in range(count):
        for j in range(state_row.DIM):
            rows[first + k, j] = work[j, k]


@njit(parallel=True)
def fly_rows(rows, orders, params, dt, substeps):
    """Advance every row of (N, state_row.DIM) in place by one control period of `dt` s in `substeps` steps of physics.

    `orders` (N, order_row.DIM), `params` (N, airframe_row.DIM).
    """
    for block in prange((rows.shape[0] + LANES - 1) // LANES):
        fly_block(rows, orders, params, block * LANES, dt / substeps, substeps)
