"""PX4's time put on the run's clock: by the driver's time synchronisation, checked by the vehicle's body rates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hil.report.recorded.columns import Columns
from hil.report.recorded.ulog import PX4Log

_AROUND_S, _STEP_S = 0.4, 0.01  # how far from the synchronisation the body rates are tried, and how finely
_GRID_HZ, _LONGEST_S = 50.0, 3600.0  # of the search without a synchronisation
_SEGMENTS, _LEAST = 8, 40  # parts of the flight that are compared one by one, samples each
_AGREE = 0.7  # correlation from which on both are the same motion
_FRD = np.array([1.0, -1.0, -1.0])  # FRD as FLU


class RateCheck(NamedTuple):
    """Run's clock less the log's as put on it, from body rates: s, one sigma (s), correlation (-1 to 1)."""

    offset: float
    sigma: float
    correlation: float


@dataclass(frozen=True)
class LogClock:
    """`px4_ns` (k,) of PX4's time at `ours_ns` (k,) of the run's; `source` says by what; `check` is None without rates.

    `trouble`: why the log is not that of this run, or cannot be put on its clock; empty if it can.
    """

    source: str
    px4_ns: np.ndarray
    ours_ns: np.ndarray
    check: RateCheck | None
    trouble: str = ""

    def run_ns(self, us: np.ndarray) -> np.ndarray:
        """The run's time of PX4 times, int64 (n,); before the first and after the last known offset that one counts."""
        px4 = np.asarray(us, dtype=np.int64) * 1000
        offset = np.interp(px4, self.px4_ns, (self.px4_ns - self.ours_ns).astype(np.float64))
        return px4 - np.round(offset).astype(np.int64)


def log_rates(log: PX4Log) -> tuple[np.ndarray, np.ndarray] | None:
    """PX4's gyro: time of its samples (us), body rates (n, 3) in rad/s FLU; None without."""
    gyro = log.topics.get("vehicle_angular_velocity")
    if gyro is None:
        return None
    taken = gyro.fields.get("timestamp_sample")
    us = gyro.us if taken is None else taken.astype(np.int64)
    rates = gyro.vector("xyz", 3) * _FRD
    good = np.all(np.isfinite(rates), axis=1)
    good[1:] &= np.diff(us) > 0
    return (us[good], rates[good]) if good.sum() > 1 else None


def align(log: PX4Log, status: Columns | None, odometry: Columns | None) -> LogClock:
    """`status`, `odometry`: the run's vehicle/status and vehicle/odometry, as far as it has them."""
    clock = _synchronised(status)
    rates, seen = log_rates(log), _odometry_rates(odometry)
    if rates is None or seen is None:
        why = "the log has no vehicle_angular_velocity" if rates is None else "the run has no vehicle/odometry"
        if clock is None:
            return LogClock("", *_nothing(), None, f"the run does not tell PX4's time, and {why}")
        return LogClock("time synchronisation", *clock, None)
    ours_s, of_run = seen
    if clock is None:
        shift = _search(ours_s, of_run, rates[0] / 1e6, rates[1])
        base = np.array([rates[0][0] * 1000], dtype=np.int64)
        clock, source = (base, base + round(shift * 1e9)), "body rates"
    else:
        source = "time synchronisation"
    placed = LogClock(source, *clock, None)
    check = _compare(ours_s, of_run, placed.run_ns(rates[0]) / 1e9, rates[1])
    trouble = ""
    if check is None or not check.correlation >= _AGREE:
        found = "do not overlap" if check is None else f"correlate by {check.correlation:.2f} only"
        trouble = f"body rates of log and run {found}: it is hardly the log of this flight"
    elif source == "body rates":  # nothing else is known: the best fit is the clock
        px4, ours = clock
        placed = LogClock(source, px4, ours + round(check.offset * 1e9), None)
        check = check._replace(offset=0.0)
    return LogClock(source, placed.px4_ns, placed.ours_ns, check, trouble)


def _nothing() -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64)


def _synchronised(status: Columns | None) -> tuple[np.ndarray, np.ndarray] | None:
    """(PX4's time, the run's time) where the driver knew its offset."""
    if status is None:
        return None
    ours, offset = status.nanoseconds(), status.nanoseconds("clock_offset_ns")
    known = offset != 0
    px4 = (ours + offset)[known]
    rising = np.append(True, np.diff(np.maximum.accumulate(px4)) > 0)[: len(px4)]
    return (px4[rising], ours[known][rising]) if known.any() else None


def _odometry_rates(odometry: Columns | None) -> tuple[np.ndarray, np.ndarray] | None:
    """(s of the run's clock, body rates) of the run's odometry, in order and finite."""
    if odometry is None:
        return None
    t, rates = odometry.nanoseconds() / 1e9, odometry["body_rate"]
    good = np.all(np.isfinite(rates), axis=1)
    good[1:] &= np.diff(t) > 0
    return (t[good], rates[good]) if good.sum() > _LEAST else None


def _search(t: np.ndarray, rates: np.ndarray, log_t: np.ndarray, logged: np.ndarray) -> float:
    """The run's time less the log's (s) at which both move alike: the highest cross-correlation over all shifts."""
    spans = [min(one[-1] - one[0], _LONGEST_S) for one in (t, log_t)]
    ours, theirs = (
        np.column_stack([np.interp(first + np.arange(0, span, 1 / _GRID_HZ), at, w[:, i]) for i in range(3)])
        for at, w, first, span in ((t, rates, t[0], spans[0]), (log_t, logged, log_t[0], spans[1]))
    )
    size = 1 << (len(ours) + len(theirs)).bit_length()
    spectra = np.fft.rfft(ours - ours.mean(0), size, axis=0) * np.conj(
        np.fft.rfft(theirs - theirs.mean(0), size, axis=0)
    )
    found = np.fft.irfft(spectra.sum(axis=1), size)
    lag = int(np.argmax(found))
    lag = lag - size if lag > size // 2 else lag
    return float(t[0] - log_t[0] + lag / _GRID_HZ)


def _compare(t: np.ndarray, rates: np.ndarray, log_t: np.ndarray, logged: np.ndarray) -> RateCheck | None:
    """How much later (s) the run shows the motion that the log shows, both on the run's clock.

    Least squares on the whole flight; the scatter between its parts gives the uncertainty, since the residuals are no
    white noise.
    """
    inside = (t > log_t[0] + _AROUND_S) & (t < log_t[-1] - _AROUND_S)
    t, rates = t[inside], rates[inside]
    if len(t) < _LEAST * 2:
        return None
    slope = np.gradient(logged, log_t, axis=0)

    def at(shift: float, what: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(t - shift, log_t, what[:, i]) for i in range(3)])

    tried = np.arange(-_AROUND_S, _AROUND_S + _STEP_S / 2, _STEP_S)
    shift = float(tried[np.argmin([np.square(rates - at(s, logged)).sum() for s in tried])])
    weight = gain = np.zeros(len(t))
    for _ in range(6):
        turned, change = at(shift, logged), at(shift, slope)
        weight, gain = np.square(change).sum(axis=1), -((rates - turned) * change).sum(axis=1)
        if not weight.sum() > 0.0:
            return None
        shift += float(np.clip(gain.sum() / weight.sum(), -_STEP_S, _STEP_S))
    parts = [part for part in np.array_split(np.arange(len(t)), _SEGMENTS) if weight[part].sum() > 0.0]
    share = np.array([weight[part].sum() for part in parts]) / weight.sum()
    apart = np.array([gain[part].sum() / weight[part].sum() for part in parts])
    few = max(1, len(parts) - 1)
    sigma = float(np.sqrt(np.square(share * (apart - (share * apart).sum())).sum() * len(parts) / few))
    a, b = rates - rates.mean(0), at(shift, logged)
    b = b - b.mean(0)
    scale = float(np.sqrt(np.square(a).sum() * np.square(b).sum()))
    return RateCheck(shift, sigma, float((a * b).sum()) / scale if scale > 0.0 else 0.0)
