"""Prediction of the board during a gap in detections, from the last good prediction instead of the filter's model.

The filter's model lets the acceleration decay. A prediction made while the board was in view includes the speed law
that was fitted to it. That prediction is kept, and evaluated at later times until the board is detected again.
"""

from __future__ import annotations

from groundcar.motion import board_row
from kernel.jit import njit
from policies.estimation import belief_state
from policies.prediction import coast_row
from policies.prediction.future import HORIZON, board_at

_FRESH = 0.06  # s: a prediction made on an exposure this young is kept
_GAP = 0.085  # s since the last exposure: from here on the kept prediction counts; between two control steps
_LONGEST = 2.0  # s: an older prediction is not used


@njit
def coast_keep(row, t, age, future):
    """Keep `future` ((HORIZON, 8), first row at `t` s) if the belief it came from is `age` s young enough."""
    if age >= _FRESH:
        return
    row[coast_row.TIME], row[coast_row.KEPT] = t, 1.0
    for k in range(future.shape[0]):
        for i in range(board_row.DIM):
            row[coast_row.FUTURE + board_row.DIM * k + i] = future[k, i]


@njit
def coasting(row, t, age):
    """True if the board was last seen too long ago for the filter, but not for the kept prediction."""
    since = t - row[coast_row.TIME]
    return row[coast_row.KEPT] > 0.0 and age > _GAP and 0.0 < since < _LONGEST


@njit
def coast_state(row, t, step, x):
    """The board at `t` by the kept prediction, into `x` ((8,), policies.estimation.belief_state)."""
    rows, since = row[coast_row.FUTURE : coast_row.DIM].reshape(HORIZON, board_row.DIM), t - row[coast_row.TIME]
    board_at(rows, step, since + step, x)
    later = x[belief_state.SPEED]
    board_at(rows, step, since, x)
    x[belief_state.ACCELERATION] = (later - x[belief_state.SPEED]) / step


@njit
def coast_future(row, t, step, future):
    """Fill `future` ((K, 8), first row at `t`) from the kept prediction."""
    rows, since = row[coast_row.FUTURE : coast_row.DIM].reshape(HORIZON, board_row.DIM), t - row[coast_row.TIME]
    for k in range(future.shape[0]):
        board_at(rows, step, since + k * step, future[k])
        future[k, board_row.U] = 0.0
