"""Planning a perch as Fast-Perching does (Ji et al., IROS 2022): snap, time and skid are minimised under penalties.

L-BFGS begins from a guess or from the last plan. Weights and settings are those of the published launch file where the
airframe has none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from policies.baselines import carried_row, variables_row
from policies.baselines import fast_perching_cost as fp
from policies.baselines.fast_perching_params import FastPerchingParams
from policies.baselines.min_snap import BOUNDARY, END, PIECES, basis, min_snap
from policies.baselines.smoothing import piece_variable

_MEMORY, _PAST, _DELTA = 32, 3, 1e-4
_MOST_ITERATIONS = 300
_CALM, _LONGEST = 1.5, 20.0  # a guess' body rate over the limit, at most; its duration at most, s


@dataclass(frozen=True)
class PerchPlan:
    """`pieces` ((PIECES, ORDER, 3)), time counted in pieces of `seconds`; the `variables` and `cost` behind them."""

    pieces: np.ndarray
    seconds: float
    variables: np.ndarray
    cost: float

    @property
    def duration(self) -> float:
        """Seconds to contact."""
        return PIECES * self.seconds

    def at(self, t: float) -> np.ndarray:
        """Position, velocity, acceleration and jerk ((4, 3)) at `t` s; overdue, the end moves on at its velocity."""
        along = min(max(t / self.seconds, 0.0), float(PIECES))
        k = min(int(along), PIECES - 1)
        state = np.array([basis(along - k, d) @ self.pieces[k] / self.seconds**d for d in range(4)])
        state[0] += max(0.0, t - self.duration) * state[1]
        return state


def plan_perch(
    start: np.ndarray, board: np.ndarray, params: FastPerchingParams, last: tuple[PerchPlan, float] | None = None
) -> PerchPlan:
    """The plan from `start` ((4, 3): position, velocity, acceleration, jerk; world) to `board` ((8,) board row now).

    `last`: the plan before and how many s of it are flown; it is where the search begins. Raises ValueError as
    `load_search` does.
    """
    minimize = load_search()
    curve, settings = min_snap(), params.row()
    guess = _guess(start, board, params) if last is None else _resample(*last)

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        gradient = np.zeros(variables_row.DIM)
        value = fp.cost_and_gradient(x, start, board, settings, *curve[1:], gradient)
        return value, gradient

    options = {"maxcor": _MEMORY, "maxiter": _MOST_ITERATIONS, "ftol": 0.0, "gtol": 0.0}
    found = minimize(cost, guess, jac=True, method="L-BFGS-B", options=options, callback=_Enough())
    return _plan(found.x, float(found.fun), start, board, settings)


class _Enough:
    """Ends a search whose cost fell by less than the share _DELTA over _PAST iterations."""

    def __init__(self) -> None:
        self._costs: list[float] = []

    def __call__(self, intermediate_result) -> None:
        self._costs.append(float(intermediate_result.fun))
        if len(self._costs) > _PAST and self._costs[-1 - _PAST] - self._costs[-1] < _DELTA * abs(self._costs[-1]):
            raise StopIteration


@lru_cache(maxsize=1)
def load_search():
    """SciPy's minimiser on one thread. Raises ValueError, saying what to install, where there is none.

    Its matrices have 31 rows: several threads would make a plan ten times slower.
    """
    try:
        from scipy.optimize import minimize
        from threadpoolctl import ThreadpoolController
    except ImportError:
        raise ValueError("Fast-Perching needs SciPy: pip install scipy") from None
    return ThreadpoolController().wrap(limits=1, user_api="blas")(minimize)


def _plan(x: np.ndarray, cost: float, start: np.ndarray, board: np.ndarray, settings: np.ndarray) -> PerchPlan:
    boundary = np.zeros((3, BOUNDARY))
    seconds = fp.fill_boundary(x, start, board, settings, boundary, np.zeros(carried_row.DIM))
    pieces = np.einsum("kob,ib->koi", min_snap().coefficients, boundary)
    return PerchPlan(pieces, seconds, x.copy(), cost)


def _resample(plan: PerchPlan, flown: float) -> np.ndarray:
    """The part of a plan that is left, as variables."""
    x = plan.variables.copy()
    left = max(plan.duration - flown, 0.05)
    x[variables_row.TIME] = piece_variable(left / PIECES)
    for k in range(1, PIECES):
        at = variables_row.WAYPOINTS + 3 * (k - 1)
        x[at : at + 3] = plan.at(flown + left * k / PIECES)[0]
    return x


def _guess(start: np.ndarray, board: np.ndarray, params: FastPerchingParams) -> np.ndarray:
    """Way points on one polynomial to contact, with a duration long enough for moderate body rates."""
    duration = max(0.3, float(np.linalg.norm(board[:3] - start[0])) / params.speed_max)
    x, settings = np.zeros(variables_row.DIM), params.row()
    boundary, times = np.zeros((3, BOUNDARY)), np.linspace(0.0, 1.0, 41)
    while True:
        x[variables_row.TIME] = piece_variable(duration / PIECES)
        h = fp.fill_boundary(x, start, board, settings, boundary, np.zeros(carried_row.DIM))
        ends = boundary[:, [0, 1, 2, 3, END, END + 1, END + 2, END + 3]]
        ends = ends * np.tile((duration / h) ** np.arange(4), 2)
        rows = [basis(t, d) for t in (0.0, 1.0) for d in range(4)]
        whole = np.linalg.solve(np.array(rows), ends.T)
        if _fastest_turn(whole, times, duration, params.gravity) <= _CALM * params.rate_max or duration > _LONGEST:
            break
        duration += 1.0
    for k in range(1, PIECES):
        at = variables_row.WAYPOINTS + 3 * (k - 1)
        x[at : at + 3] = basis(k / PIECES, 0) @ whole
    return x


def _fastest_turn(whole: np.ndarray, times: np.ndarray, duration: float, gravity: float) -> float:
    """Largest body rate (rad/s) along a polynomial ((ORDER, 3), time in durations)."""
    force = np.array([basis(t, 2) @ whole for t in times]) / duration**2 + (0.0, 0.0, gravity)
    jerk = np.array([basis(t, 3) @ whole for t in times]) / duration**3
    size = np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-6)
    up = force / size
    across = jerk - up * (up * jerk).sum(1, keepdims=True)
    return float(np.linalg.norm(across / size, axis=1).max())
