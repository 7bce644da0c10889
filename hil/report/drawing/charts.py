"""Plots over time as data for the page's script: time series in, one table of packed arrays out."""

from __future__ import annotations

import base64
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
    """One plot on the linked time axis. `lines` are horizontal limits (value, name); `fixed` keeps the y axis there."""

    key: str
    title: str
    unit: str
    series: list[Series] = field(default_factory=list)
    lines: list[tuple[float, str]] = field(default_factory=list)
    fixed: tuple[float, float] | None = None
    height: int = 150

    def add(self, name: str, colour: str, t: np.ndarray, y: np.ndarray, style: str = "line") -> None:
        self.series.append(Series(name, colour, t, np.asarray(y, dtype=np.float64), style))

    @property
    def drawable(self) -> bool:
        """True if there is at least one number to draw."""
        return any(np.isfinite(s.y).any() for s in self.series)


class Pack:
    """Collects plots of one or more flights for the page; equal arrays are kept once."""

    def __init__(self) -> None:
        self._arrays: list[str] = []
        self._index: dict[bytes, int] = {}
        self.plots: list[dict[str, Any]] = []

    def add(self, flight: int, recorded: Recorded, plot: TimePlot) -> str:
        """Pack a plot; returns the id of the element the page puts it in."""
        series = []
        for s in plot.series:
            keep = thin(recorded, s.t, s.y, every=s.style != "dots")
            keep = keep[np.argsort(s.t[keep], kind="stable")]  # the page searches in them
            t, y = recorded.seconds(s.t[keep]), s.y[keep]
            series.append(
                {"name": s.name, "colour": s.colour, "style": s.style, "t": self._array(t), "y": self._array(y)}
            )
        ident = f"plot-{flight}-{plot.key}"
        self.plots.append(
            {
                "id": ident, "key": plot.key, "flight": flight, "title": plot.title, "unit": plot.unit,
                "series": series, "lines": plot.lines, "fixed": plot.fixed, "height": plot.height,
            }
        )  # fmt: skip
        return ident

    def _array(self, values: np.ndarray) -> int:
        data = values.astype("<f4").tobytes()
        if data not in self._index:
            self._index[data] = len(self._arrays)
            self._arrays.append(base64.b64encode(data).decode("ascii"))
        return self._index[data]

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
