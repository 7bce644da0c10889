"""Carrying the board through a gap in sight on the last good prediction, rather than on the filter's own model.

The filter lets the acceleration decay, because it does not know better. A prediction made while the board was in view
does: it has seen the speed law. So that prediction is kept, and read off at a later time while nothing is seen.
"""

from __future__ import annotations

from kernel.jit import njit
from policies.prediction.future import HORIZON, board_at

# A coast row: time of the kept prediction (s), whether there is one, then its rows.
C_TIME, C_KEPT, C_ROWS = 0, 1, 2
COAST_DIM = C_ROWS + 8 * HORIZON

_FRESH = 0.06  # s: a prediction made on an exposure this young is kept
_GAP = 0.085  # s since the last exposure: from here on the kept prediction counts; between two control steps
_LONGEST = 2.0  # s: an older prediction is worth no more than the filter's


@njit
def coast_keep(row, t, age, future):
    """Keep `future` ((HORIZON, 8), first row at `t` s) if the belief it came from is `age` s young enough."""
    if age >= _FRESH:
        return
    row[C_TIME], row[C_KEPT] = t, 1.0
    for k in range(future.shape[0]):
        for i in range(8):
            row[C_ROWS + 8 * k + i] = future[k, i]


@njit
def coasting(row, t, age):
    """True if the board was last seen too long ago for the filter, but not for the kept prediction."""
    since = t - row[C_TIME]
    return row[C_KEPT] > 0.0 and age > _GAP and 0.0 < since < _LONGEST


@njit
def coast_state(row, t, step, x):
    """The board at `t` as foretold, into `x` ((8,): board row whose last entry is the acceleration, m/s^2)."""
    rows, since = row[C_ROWS:COAST_DIM].reshape(HORIZON, 8), t - row[C_TIME]
    board_at(rows, step, since + step, x)
    later = x[4]
    board_at(rows, step, since, x)
    x[7] = (later - x[4]) / step


@njit
def coast_future(row, t, step, future):
    """Fill `future` ((K, 8), first row at `t`) from the kept prediction."""
    rows, since = row[C_ROWS:COAST_DIM].reshape(HORIZON, 8), t - row[C_TIME]
    for k in range(future.shape[0]):
        board_at(rows, step, since + k * step, future[k])
        future[k, 7] = 0.0
