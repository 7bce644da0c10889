"""Estimate against truth: the belief about the board, single detections, the autopilot's odometry."""

from __future__ import annotations

import numpy as np

from hil.report.drawing.charts import BELIEF, BOARD, MUTED, SEEN, VEHICLE, TimePlot
from hil.report.drawing.section import Section, table
from hil.report.recorded.columns import Columns
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import Motion, at, axes, nose_up_deg

# Indices of the state in Belief.variance: x, y, z, heading, speed, turn rate, inclination, acceleration, heading bias.
_X, _Y, _Z = 0, 1, 2
_CHI2_95 = 7.815  # 95 % quantile of chi-squared with three degrees of freedom


def build(recorded: Recorded) -> Section:
    section = Section("estimate", "Estimate against truth")
    what = "errors of the board's estimate"
    if section.needs_pose(recorded, what, vehicle=False) and section.needs(recorded, what, "belief"):
        assert recorded.board is not None
        _belief(section, recorded, recorded.board)
    if section.needs(recorded, "errors of the odometry", "vehicle/odometry"):
        if recorded.vehicle is None or recorded.vehicle_source == "vehicle/odometry":
            section.lost.append(("errors of the odometry", "no messages on truth/vehicle or mocap/vehicle"))
        else:
            _odometry(section, recorded, recorded.vehicle)
    return section


def _belief(section: Section, recorded: Recorded, truth: Motion) -> None:
    belief = recorded.topics["belief"]
    t, known = belief.nanoseconds(), belief["valid"] > 0
    there = at(truth, t)
    error = belief["position"] - there.position
    frame = axes(there.orientation)
    heading = np.arctan2(-frame[:, 0, 1], frame[:, 1, 1])  # of the board's left axis, which stays level
    c, s = np.cos(heading), np.sin(heading)
    ahead, left = c * error[:, 0] + s * error[:, 1], -s * error[:, 0] + c * error[:, 1]

    def only(values: np.ndarray) -> np.ndarray:
        return np.where(known, values, np.nan)

    plot = TimePlot("belief-position", "Board position, estimate minus truth", "m")
    for name, colour, values in (("ahead", BELIEF, ahead), ("left", BOARD, left), ("up", VEHICLE, error[:, 2])):
        plot.add(name, colour, t, only(values))
    variance = belief["variance"]
    if variance.ndim == 2 and variance.shape[1] > _Z:
        two_sigma = 2 * np.sqrt(np.maximum(0.0, variance[:, [_X, _Y, _Z]].max(axis=1)))
        plot.add("2 sigma of the filter", MUTED, t, only(two_sigma), "dash")
        plot.add("", MUTED, t, only(-two_sigma), "dash")
    _settle(plot, 0.6)
    section.plot(plot)
    _consistency(section, recorded, truth)

    detections = recorded.topics.get("board/detection")
    if detections is not None and (detections["found"] > 0).any():
        found = detections["found"] > 0
        exposed = detections.nanoseconds()[found]
        miss = np.linalg.norm(detections["position"][found] - at(truth, exposed).position, axis=1)
        plot = TimePlot(
            "detection-error", "Board position, single detections: distance from truth at exposure", "m", height=120
        )
        plot.add("detection", SEEN, exposed, miss, "dots")
        plot.add("one sigma, predicted", MUTED, exposed, detections["position_sigma"][found], "dots")
        section.plot(plot)
    else:
        section.lost.append(("errors of single detections", "no picture showed the board"))

    plot = TimePlot("belief-angles", "Board heading and inclination, estimate minus truth", "deg", height=120)
    turn = (belief["heading"] - heading + np.pi) % (2 * np.pi) - np.pi
    plot.add("heading", BELIEF, t, only(np.degrees(turn)))
    plot.add("inclination", BOARD, t, only(np.degrees(belief["inclination"]) - nose_up_deg(there.orientation)))
    _settle(plot, 30.0)
    section.plot(plot)

    plot = TimePlot("belief-speed", "Board speed, estimate and truth", "m/s", height=120)
    along = c * there.velocity[:, 0] + s * there.velocity[:, 1]
    plot.add("estimate", BELIEF, t, only(belief["speed"]))
    plot.add("truth", BOARD, t, along, "dash")
    section.plot(plot)


def _consistency(section: Section, recorded: Recorded, truth: Motion) -> None:
    """NEES and NIS of the position, each divided by its three dimensions: 1 on average if the filter is consistent.

    Bar-Shalom, Li, Kirubarajan 2001, sec. 5.4, with the recorded diagonals in place of the whole covariances.
    """
    belief = recorded.topics["belief"]
    variance = belief["variance"]
    if variance.ndim != 2 or variance.shape[1] <= _Z:
        section.lost.append(("NEES and NIS of the board's position", "the belief holds no variance"))
        return
    t, known = belief.nanoseconds(), belief["valid"] > 0
    spread = np.where(known[:, None] & (variance[:, [_X, _Y, _Z]] > 0), variance[:, [_X, _Y, _Z]], np.nan)
    nees = ((belief["position"] - at(truth, t).position) ** 2 / spread).mean(axis=1)
    plot = TimePlot("consistency", "Consistency of the board's position: NEES and NIS per dimension", "1", height=120)
    plot.add("NEES", BELIEF, t, nees)
    nis, exposed = np.empty(0), np.empty(0, dtype=np.int64)
    detections = recorded.topics.get("board/detection")
    if detections is not None and (detections["found"] > 0).any() and len(t) > 1:
        found = detections["found"] > 0
        exposed = detections.nanoseconds()[found]
        before = np.clip(np.searchsorted(t, exposed, side="right") - 1, 0, None)  # the belief without this detection
        moved = belief["position"][before] + _velocity(belief)[before] * ((exposed - t[before]) / 1e9)[:, None]
        sigma = detections["position_sigma"][found][:, None]
        nis = ((detections["position"][found] - moved) ** 2 / (spread[before] + sigma**2)).mean(axis=1)
        plot.add("NIS", SEEN, exposed, nis, "dots")
    plot.lines.append((1.0, "consistent"))
    values = np.concatenate([nees, nis])
    high = values[np.isfinite(values)]
    if len(high):
        plot.fixed = (0.0, float(max(2.0, min(high.max(), 20.0))))
    section.plot(plot)
    rows: list[tuple[object, ...]] = []
    for name, when, values in (("NEES", t, nees), ("NIS", exposed, nis)):
        chosen = values[recorded.during(when) & np.isfinite(values)] if len(values) else values
        if len(chosen):
            within = f"{100 * np.mean(chosen <= _CHI2_95 / 3):.0f} %"
            rows.append((name, len(chosen), f"{chosen.mean():.2f}", f"{np.median(chosen):.2f}", within))
    if rows:
        head = ("position, during the attempt", "n", "mean (1)", "median (0.79)", "within the 95 % bound (95 %)")
        section.html(table(head, rows, "narrow"))
        section.text(
            "In brackets: a consistent filter. Not in the filter's model: errors that last for seconds, alike in "
            "consecutive pictures. The tilt of the camera mount, and the odometry's attitude, move each detection by "
            "their error times the distance to the board; the filter takes the errors of detections as independent."
        )


def _velocity(belief: Columns) -> np.ndarray:
    """The board's velocity by the belief (n, 3), m/s, world."""
    heading, speed = belief["heading"], belief["speed"]
    return np.column_stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(len(speed))])


def _odometry(section: Section, recorded: Recorded, truth: Motion) -> None:
    odometry = recorded.motion("vehicle/odometry")
    if odometry is None:
        section.lost.append(("errors of the odometry", "no usable sample"))
        return
    there = at(truth, odometry.t)
    dot = np.clip(np.abs(np.sum(odometry.orientation * there.orientation, axis=1)), 0.0, 1.0)
    for name, unit, values in (
        ("position", "m", np.linalg.norm(odometry.position - there.position, axis=1)),
        ("velocity", "m/s", np.linalg.norm(odometry.velocity - there.velocity, axis=1)),
        ("attitude", "deg", np.degrees(2 * np.arccos(dot))),
    ):
        plot = TimePlot(f"odometry-{name}", f"The vehicle's own estimate: error of its {name}", unit, height=90)
        plot.add("error", VEHICLE, odometry.t, values)
        section.plot(plot)


def _settle(plot: TimePlot, most: float) -> None:
    """Keep the axis readable if the estimate runs away: not beyond `most` unless the median itself is."""
    values = np.concatenate([s.y[np.isfinite(s.y)] for s in plot.series])
    if len(values) and np.abs(values).max() > most >= 2 * np.median(np.abs(values)):
        plot.fixed = (-most, most)
