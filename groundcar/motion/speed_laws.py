"""What forward speed is asked of the board, as a kernel: constant, Ornstein-Uhlenbeck, cosine, scheduled.

A speed row has shape (S,), float64. Every law may be perturbed by the paper's OU factor exp(eta) if SIGMA > 0.
On a reciprocating line the law gives the peak speed; the line's own cosine comes from its phase (trajectories.LINE).
"""

from __future__ import annotations

import math

import numpy as np

from kernel.jit import njit
from kernel.random import normal

CONSTANT, OU, COSINE, SCHEDULED = range(4)
KINDS = {"constant": CONSTANT, "ou": OU, "cosine": COSINE, "scheduled": SCHEDULED}

V = 0  # m/s: speed of CONSTANT and OU, minimum of COSINE, first of SCHEDULED
V2 = 1  # m/s: maximum of COSINE, second of SCHEDULED
PERIOD = 2  # s, of COSINE; RAMP of SCHEDULED shares the place
RAMP = 2
PHASE = 3  # rad, of COSINE
SWITCH = 4  # s, when SCHEDULED begins to change; inf: not yet known
TAU, SIGMA = 5, 6  # s and 1, of the OU factor; SIGMA 0 draws nothing
S = 8

ETA = 0  # index in the law's state row (1,): logarithm of the OU factor


@njit
def speed_nominal(kind, params, t):
    """The law's speed (m/s) at `t` seconds after the start, without the OU factor."""
    if kind == COSINE:
        swing = 0.5 * (1.0 + math.cos(2.0 * math.pi * t / params[PERIOD] + params[PHASE]))
        return params[V] + (params[V2] - params[V]) * swing
    if kind == SCHEDULED and t > params[SWITCH]:
        since = t - params[SWITCH]
        if since >= params[RAMP]:
            return params[V2]
        return params[V] + (params[V2] - params[V]) * since / params[RAMP]
    return params[V]


@njit
def speed_law(kind, params, state, t, dt, stream):
    """The asked speed (m/s) at `t` seconds after the start; advances `state` (1,) by `dt` s if SIGMA > 0.

    The OU factor is the paper's: beta = dt / (tau + dt), eta <- (1 - beta) eta + sigma sqrt(beta) eps, v exp(eta).
    `stream` ((1,) uint64) is touched only then.
    """
    v = speed_nominal(kind, params, t)
    if params[SIGMA] > 0.0:
        beta = dt / (params[TAU] + dt)
        state[ETA] = (1.0 - beta) * state[ETA] + params[SIGMA] * math.sqrt(beta) * normal(stream)
        v *= math.exp(state[ETA])
    return v


@njit
def speed_peak(kind, params):
    """Largest nominal speed (m/s): the v_des that a spline's curvature is checked against."""
    if kind in (COSINE, SCHEDULED):
        return max(params[V], params[V2])
    return params[V]


def _row(**values: float) -> np.ndarray:
    row = np.zeros(S)
    row[TAU], row[PERIOD], row[SWITCH] = 1.0, 1.0, math.inf
    for name, value in values.items():
        if math.isnan(value) or (value < 0.0 and name not in ("PHASE", "SWITCH")):
            raise ValueError(f"{name.lower()} of a speed law is {value}: give a number that is not negative")
        row[globals()[name]] = value
    return row


def constant_speed(speed: float) -> np.ndarray:
    """Speed row (S,) of kind CONSTANT. Raises ValueError for NaN or a negative number, as all builders here."""
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
