"""Speed laws of the board as kernels: constant, Ornstein-Uhlenbeck, oscillating (cosine), scheduled.

A speed row (groundcar.motion.speed_row) holds the numbers of one law. Every law may be perturbed by the paper's OU
factor exp(eta) if SIGMA > 0. On a reciprocating line the law gives the peak speed; the line's own cosine comes from its
phase (paths.LINE).
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import speed_row
from kernel.jit import njit
from kernel.random import normal

CONSTANT, OU, COSINE, SCHEDULED = range(4)
KINDS = {"constant": CONSTANT, "ou": OU, "cosine": COSINE, "scheduled": SCHEDULED}

ETA = 0  # index in the law's state row (1,): logarithm of the OU factor


@njit
def speed_nominal(kind, params, t):
    """The law's speed (m/s) at `t` seconds after the start, without the OU factor."""
    if kind == COSINE:
        share = 0.5 * (1.0 + math.cos(2.0 * math.pi * t / params[speed_row.PERIOD] + params[speed_row.PHASE]))
        return params[speed_row.V] + (params[speed_row.V2] - params[speed_row.V]) * share
    if kind == SCHEDULED and t > params[speed_row.SWITCH]:
        since = t - params[speed_row.SWITCH]
        if since >= params[speed_row.RAMP]:
            return params[speed_row.V2]
        return params[speed_row.V] + (params[speed_row.V2] - params[speed_row.V]) * since / params[speed_row.RAMP]
    return params[speed_row.V]


@njit
def speed_law(kind, params, state, t, dt, stream):
    """The asked speed (m/s) at `t` seconds after the start; advances `state` (1,) by `dt` s if SIGMA > 0.

    The OU factor is the paper's: beta = dt / (tau + dt), eta <- (1 - beta) eta + sigma sqrt(beta) eps, v exp(eta).
    `stream` ((1,) uint64) is drawn from only then.
    """
    v = speed_nominal(kind, params, t)
    if params[speed_row.SIGMA] > 0.0:
        beta = dt / (params[speed_row.TAU] + dt)
        state[ETA] = (1.0 - beta) * state[ETA] + params[speed_row.SIGMA] * math.sqrt(beta) * normal(stream)
        v *= math.exp(state[ETA])
    return v


@njit
def speed_peak(kind, params):
    """Largest nominal speed (m/s): the v_des that a spline's curvature is checked against."""
    if kind in (COSINE, SCHEDULED):
        return max(params[speed_row.V], params[speed_row.V2])
    return params[speed_row.V]


def _row(**values: float) -> np.ndarray:
    row = np.zeros(speed_row.DIM)
    row[speed_row.TAU], row[speed_row.PERIOD], row[speed_row.SWITCH] = 1.0, 1.0, math.inf
    for name, value in values.items():
        if math.isnan(value) or (value < 0.0 and name not in ("PHASE", "SWITCH")):
            raise ValueError(f"{name.lower()} of a speed law is {value}: give a number that is not negative")
        row[getattr(speed_row, name)] = value
    return row


def constant_speed(speed: float) -> np.ndarray:
    """Speed row of kind CONSTANT. Raises ValueError for NaN or a negative number, as all builders here."""
    return _row(V=speed)


def ou_speed(speed: float, tau: float = 1.0, sigma: float = 0.1) -> np.ndarray:
    """Speed row of kind OU (paper: tau 1 s, sigma 0.1)."""
    if tau <= 0.0:
        raise ValueError(f"tau of the OU speed law is {tau} s: it must be positive")
    return _row(V=speed, TAU=tau, SIGMA=sigma)


def cosine_speed(minimum: float = 1.0, maximum: float = 2.5, period: float = 3.0, phase: float = 0.0) -> np.ndarray:
    """Speed row of kind COSINE (paper's Hard-I: 1.0 to 2.5 m/s, 3 s); `phase` in rad."""
    if minimum > maximum or period <= 0.0:
        raise ValueError(f"a cosine speed law needs minimum <= maximum and period > 0, not {minimum, maximum, period}")
    return _row(V=minimum, V2=maximum, PERIOD=period, PHASE=phase)


def scheduled_speed(first: float, second: float, ramp: float = 0.5, switch: float = math.inf) -> np.ndarray:
    """Speed row of kind SCHEDULED: `first`, from `switch` s within `ramp` s linearly to `second`.

    Leave `switch` at inf where `groundcar.motion.board_motion` decides when the path changes: it writes the time then.
    """
    return _row(V=first, V2=second, RAMP=ramp, SWITCH=switch)
