"""A fit of the board's speed over the last seconds, to predict the next ones.

An oscillating speed (paper's Hard-I: 1.0 to 2.5 m/s every 3 s) does not show in one belief. The believed speeds of the
last five seconds are fitted with a constant plus one sinusoid, at each of a few periods. A fit that predicts the newest
of them well is continued; otherwise the prediction is left as it is.
"""

from __future__ import annotations

import math

from kernel.clip import clip
from kernel.jit import njit
from policies.prediction import oscillation_row, speeds_row

SAMPLE = 0.05  # s between entries
LENGTH = 100  # entries: 5 s
HISTORY_DIM = speeds_row.RING + LENGTH

_PERIODS = (1.6, 1.8, 2.0, 2.2, 2.45, 2.7, 3.0, 3.3, 3.7, 4.2, 5.0, 6.5, 9.0, 14.0, 25.0)  # s
_MEMORY = 3.0  # s, older speeds count less
_LEAST = 1.0  # s of history before anything is fitted
_GAP = 1.2  # s, longest gap that is filled
_NOISE = 0.04  # m/s, of the believed speed
_SETTLE = 8  # entries after a start in which the filter's speed has not converged
_BACK = 14  # newest entries that a fit has to predict: 0.7 s
_RIDGE = 0.002
_LINE = 6  # entries to which the line through the speed is fitted that a fit has to beat

UNKNOWN = 0.3


@njit
def history_clear(history):
    """Empty the history."""
    history[:] = 0.0


@njit
def history_push(history, t, speed):
    """Append the believed `speed` (m/s, signed) at `t` (s) if the last entry is SAMPLE old.

    A gap is filled with a straight line, so that entries stay SAMPLE apart; one of more than _GAP clears. A number that
    is not finite is ignored.
    """
    if not math.isfinite(t + speed):
        return
    count = 1
    if history[speeds_row.COUNT] > 0.0:
        count = int((t - history[speeds_row.TIME]) / SAMPLE + 1e-6)
        if count < 1:
            return
        if count * SAMPLE > _GAP:
            history_clear(history)
            count = 1
    head = int(history[speeds_row.HEAD])
    before = history[speeds_row.RING + head]
    time = history[speeds_row.TIME] + count * SAMPLE if history[speeds_row.COUNT] > 0.0 else t
    for i in range(1, count + 1):
        head = (head + 1) % LENGTH
        history[speeds_row.RING + head] = before + (speed - before) * i / count
    history[speeds_row.HEAD], history[speeds_row.TIME] = head, time
    history[speeds_row.COUNT] = min(history[speeds_row.COUNT] + count, float(LENGTH))


@njit
def history_range(history):
    """(least, largest) magnitude of the stored speeds, m/s, without the first _SETTLE entries; (inf, 0) of none."""
    least, most = math.inf, 0.0
    head = int(history[speeds_row.HEAD])
    for i in range(int(history[speeds_row.COUNT]) - _SETTLE):
        speed = abs(history[speeds_row.RING + (head - i) % LENGTH])
        least, most = min(least, speed), max(most, speed)
    return least, most


@njit
def _solve3(a00, a01, a02, a11, a12, a22, b0, b1, b2):
    """Solution (3 floats) of a symmetric positive definite system by Cholesky."""
    l00 = math.sqrt(a00)
    l10, l20 = a01 / l00, a02 / l00
    l11 = math.sqrt(max(1e-12, a11 - l10 * l10))
    l21 = (a12 - l20 * l10) / l11
    l22 = math.sqrt(max(1e-12, a22 - l20 * l20 - l21 * l21))
    y0 = b0 / l00
    y1 = (b1 - l10 * y0) / l11
    y2 = (b2 - l20 * y0 - l21 * y1) / l22
    z2 = y2 / l22
    z1 = (y1 - l21 * z2) / l11
    return (y0 - l10 * z1 - l20 * z2) / l00, z1, z2


@njit
def _fit(history, skip, fit):
    """Constant + sinusoid on all but the newest `skip` entries; phase 0 is at the newest one used. False: too short."""
    n, head = int(history[speeds_row.COUNT]) - skip, int(history[speeds_row.HEAD]) - skip
    span = (n - 1) * SAMPLE
    if span < _LEAST:
        return False
    fade = math.exp(-SAMPLE / _MEMORY)
    w, sw, sv, svv = 1.0, 0.0, 0.0, 0.0
    for i in range(n):
        v = history[speeds_row.RING + (head - i) % LENGTH]
        sw, sv, svv, w = sw + w, sv + w * v, svv + w * v * v, w * fade
    best = math.inf
    for period in _PERIODS:
        omega = 2.0 * math.pi / period
        # Less than half a period is a mere parabola: the ridge keeps its amplitude sensible.
        ridge = _RIDGE * sw * (1.0 + (0.5 * period / span) ** 2)
        c, s, w = 1.0, 0.0, 1.0
        dc, ds = math.cos(omega * SAMPLE), -math.sin(omega * SAMPLE)
        sc, ss, scc, scs, sss, svc, svs = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            v = history[speeds_row.RING + (head - i) % LENGTH]
            sc, ss, scc, scs, sss = sc + w * c, ss + w * s, scc + w * c * c, scs + w * c * s, sss + w * s * s
            svc, svs = svc + w * v * c, svs + w * v * s
            c, s, w = c * dc - s * ds, c * ds + s * dc, w * fade
        m, a, b = _solve3(sw, sc, ss, scc + ridge, scs, sss + ridge, sv, svc, svs)
        left = svv - m * sv - a * svc - b * svs
        if left < best:
            best = left
            (
                fit[oscillation_row.OMEGA],
                fit[oscillation_row.COSINE],
                fit[oscillation_row.SINE],
                fit[oscillation_row.CONSTANT],
            ) = omega, a, b, m
    return True


@njit
def fit_oscillation(history, tau, fit):
    """Fit constant + sinusoid to the history; fills `fit` (policies.prediction.oscillation_row).

    Its trust is measured on the past: the same fit made _BACK entries ago must predict the entries since better than an
    acceleration that decays in `tau` s. Trust 0 means: do not use it.
    """
    fit[:] = 0.0
    fit[oscillation_row.SURPRISE] = UNKNOWN
    if int(history[speeds_row.COUNT]) < _BACK + _LINE:
        return
    fitted = _fit(history, _BACK, fit)
    head = int(history[speeds_row.HEAD])
    mean, slope, weight = 0.0, 0.0, 0.0
    for i in range(_LINE):
        v, x = history[speeds_row.RING + (head - _BACK - i) % LENGTH], 0.5 * (_LINE - 1) - i
        mean, slope, weight = mean + v / _LINE, slope + v * x, weight + x * x
    slope /= weight * SAMPLE
    then = mean + slope * 0.5 * (_LINE - 1) * SAMPLE
    oscillating, held = 0.0, 0.0  # squared errors of the fit, and of the decaying acceleration
    for i in range(_BACK):
        t, v = (_BACK - i) * SAMPLE, history[speeds_row.RING + (head - i) % LENGTH]
        oscillating += (
            v
            - fit[oscillation_row.CONSTANT]
            - fit[oscillation_row.COSINE] * math.cos(fit[oscillation_row.OMEGA] * t)
            - fit[oscillation_row.SINE] * math.sin(fit[oscillation_row.OMEGA] * t)
        ) ** 2
        held += (v - then - slope * tau * (1.0 - math.exp(-t / tau))) ** 2
    if not fitted:
        fit[oscillation_row.SURPRISE] = math.sqrt(held / _BACK)
        return
    trust = clip(1.2 * (1.0 - oscillating / (held + _BACK * _NOISE * _NOISE)), 0.0, 1.0)
    _fit(history, 0, fit)
    fit[oscillation_row.TRUST] = trust
    fit[oscillation_row.SURPRISE] = math.sqrt((trust * oscillating + (1.0 - trust) * held) / _BACK)


@njit
def oscillation_gain(fit, t):
    """Change of speed (m/s) that the fit expects from now until `t` s ahead, not yet weighted by its trust."""
    now, then = (
        fit[oscillation_row.OMEGA] * fit[oscillation_row.SINCE],
        fit[oscillation_row.OMEGA] * (fit[oscillation_row.SINCE] + t),
    )
    return fit[oscillation_row.COSINE] * (math.cos(then) - math.cos(now)) + fit[oscillation_row.SINE] * (
        math.sin(then) - math.sin(now)
    )
