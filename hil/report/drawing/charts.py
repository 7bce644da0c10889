"""Plots over time as data for the page's script: time series in, one table of packed arrays out."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hil.report.recorded.flight import Recorded

# One colour per role, the same in every plot and figure; in grey, dashes and dots distinguish them.
VEHICLE, BOARD, BELIEF, SEEN, ASKED, MUTED, BAD = (
    "#1259a8", "#c2570c", "#7b3fa0", "#12805c", "#8a8f98", "#8a8f98", "#c4262e",
)  # fmt: skip

_FINE_S = 0.007  # closest spacing of drawn samples around the attempt
_COARSE_S = 0.1  # before and after it, at least
_MOST_DOTS = 20_000  # of a series; beyond it dots are thinned as lines are
_FINE_SPAN_NS, _COARSE_SAMPLES = 60_000_000_000, 3000  # a recording of hours must not make a report of gigabytes


@dataclass
class Series:
    """`t` in ns, `y` in the plot's unit; NaN leaves a gap. style: line, dash, step or dots."""

    name: str
    colour: str
    t: np.ndarray
    y: np.ndarray
    style: str = "line"


@dataclass
class TimePlot:
    """One plot on the linked time axis, of one unit. `lines` are horizontal limits (value, name); `fixed` keeps the y
    axis there; `down`: it counts downwards, as rows of a picture do."""

    key: str
    title: str
    unit: str
    series: list[Series] = field(default_factory=list)
    lines: list[tuple[float, str]] = field(default_factory=list)
    fixed: tuple[float, float] | None = None
    height: int = 150
    down: bool = False

    def add(self, name: str, colour: str, t: np.ndarray, y: np.ndarray, style: str = "line") -> None:
        self.series.append(Series(name, colour, t, np.asarray(y, dtype=np.float64), style))

    @property
    def drawable(self) -> bool:
        """True if there is at least one number to draw."""
        return any(np.isfinite(s.y).any() for s in self.series)


class Pack:
    """Collects plots for the page; equal arrays are kept once."""

    def __init__(self) -> None:
        self._arrays: list[str] = []
        self._index: dict[bytes, int] = {}
        self.plots: list[dict[str, Any]] = []

    def add(self, flights: Sequence[tuple[Recorded, TimePlot | None]]) -> str:
        """Pack one plot of one flight, or of several on one axis; returns the id of the element the page puts it in."""
        found = [plot for _, plot in flights if plot is not None]
        first = found[0]
        limits = [plot.fixed for plot in found if plot.fixed]
        fixed = (min(low for low, _ in limits), max(high for _, high in limits)) if len(limits) == len(found) else None
        self.plots.append(
            {
                "id": f"plot-{first.key}", "key": first.key, "title": first.title, "unit": first.unit,
                "series": [
                    self._series(flight, recorded, series)
                    for flight, (recorded, plot) in enumerate(flights)
                    for series in (plot.series if plot else ())
                ],
                "lines": list(dict.fromkeys(line for plot in found for line in plot.lines)),
                "fixed": fixed, "height": first.height, "down": first.down,
            }
        )  # fmt: skip
        return self.plots[-1]["id"]

    def _series(self, flight: int, recorded: Recorded, series: Series) -> dict[str, Any]:
        keep = thin(recorded, series.t, series.y, every=series.style != "dots" or len(series.t) > _MOST_DOTS)
        keep = keep[np.argsort(series.t[keep], kind="stable")]  # the page searches in them
        t, y = self._array(recorded.seconds(series.t[keep])), self._array(series.y[keep])
        return {"flight": flight, "name": series.name, "colour": series.colour, "style": series.style, "t": t, "y": y}

    def _array(self, values: np.ndarray) -> int:
        data = values.astype("<f4").tobytes()
        key = hashlib.blake2b(data).digest()
        if key not in self._index:
            self._index[key] = len(self._arrays)
            self._arrays.append(base64.b64encode(data).decode("ascii"))
        return self._index[key]

    def table(self) -> dict[str, Any]:
        return {"arrays": self._arrays, "plots": self.plots}


def thin(recorded: Recorded, t: np.ndarray, y: np.ndarray | None = None, *, every: bool = True) -> np.ndarray:
    """Indices of the samples worth drawing: about 140 Hz from 2 s before the car drives to the end (of its last
    minute if it is longer), at most 10 Hz elsewhere.

    Of the samples that fall together the first is drawn, with `y` its least and its greatest: no peak is lost.
    `every` False keeps them all (single dots mean something each).
    """
    if not every or len(t) == 0:
        return np.arange(len(t))
    start, end = recorded.window_ns
    driving: np.ndarray | list[int] = []
    if "run/stage" in recorded.topics:
        driving = recorded.topics["run/stage"].nanoseconds("car_start_ns")
        driving = driving[driving != 0][:1]
    first = min([start, *map(int, driving)]) - 2_000_000_000
    first = max(first, end - _FINE_SPAN_NS)
    coarse = max(_COARSE_S, (recorded.span_ns[1] - recorded.span_ns[0]) / 1e9 / _COARSE_SAMPLES)
    fine = (t >= first) & (t <= end + 1_000_000_000)
    slot = t // np.where(fine, round(_FINE_S * 1e9), round(coarse * 1e9))
    group = np.concatenate([[0], np.cumsum((np.diff(slot) != 0) | (np.diff(fine.astype(np.int8)) != 0))])
    firsts = np.flatnonzero(np.diff(group, prepend=-1))
    if y is None:
        return firsts
    order = np.lexsort((y, group))  # what is not finite comes last
    lasts = np.append(firsts[1:], len(t)) - 1
    greatest = np.maximum(firsts, lasts - np.add.reduceat(np.isnan(y).astype(np.int64), firsts))
    return np.unique(order[np.concatenate([firsts, greatest])])
