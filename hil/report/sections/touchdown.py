"""Touchdown in the board's frame: the position of the magnet at contact, and its path to it."""

from __future__ import annotations

import math

import numpy as np
from markupsafe import Markup

from hil.report.drawing.charts import BOARD, MUTED, VEHICLE, TimePlot
from hil.report.drawing.section import Section
from hil.report.drawing.svg import Plane
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import Approach

_BEFORE_NS = 1_000_000_000
_REACH = 0.45  # m shown on each side of the board's centre
_GHOST_NS = 100_000_000  # between the drawn outlines of the vehicle


def build(recorded: Recorded) -> Section:
    section = Section("touchdown", "Touchdown, in the board's frame")
    if not section.needs_pose(recorded, "touchdown close-up"):
        return section
    seen = recorded.approach
    end = recorded.decided_ns
    assert seen is not None
    if end is None or not recorded.touched:
        section.title = "Nearest approach, in the board's frame"
        end = _nearest(recorded, seen)
        what = "The recording ends before a touchdown" if recorded.decided_ns is None else "It did not touch the board"
        section.text(f"{what}: this is how the vehicle came nearest, at {recorded.seconds(end):.3f} s.")
    keep = (seen.t >= end - _BEFORE_NS) & (seen.t <= end) & np.isfinite(seen.magnet).all(axis=1)
    if keep.sum() < 2:
        section.lost.append(("touchdown close-up", "no poses of both bodies at its end"))
        return section
    last = Approach(*(part[keep] for part in seen))
    section.html(
        Markup('<div class="pair">{}{}</div>').format(
            _from_above(recorded, last, end), _from_the_side(recorded, last, end)
        )
    )
    section.html(_caption(recorded))
    start, stop = recorded.window_ns
    near = (seen.t >= start) & (seen.t <= min(stop, (recorded.decided_ns or stop) + 50_000_000))
    t = seen.t[near]
    plot = TimePlot("closing", "Speed relative to the board", "m/s", height=130)
    plot.add("into the board (–normal)", VEHICLE, t, -seen.closing[near, 2])
    plot.add("along the board", BOARD, t, np.hypot(seen.closing[near, 0], seen.closing[near, 1]))
    plot.lines.append((recorded.tolerance.tangential_speed, "tangential tolerance"))
    section.plot(plot)
    plot = TimePlot("over-board", "Height of the magnet over the board", "m", height=110)
    plot.add("height", VEHICLE, t, seen.magnet[near, 2])
    section.plot(plot)
    plot = TimePlot("alignment", "Angle between the vehicle's z axis and the board's normal", "deg", height=110)
    plot.add("angle", BOARD, t, np.degrees(seen.normal_error[near]))
    plot.lines.append((math.degrees(recorded.tolerance.angle), "tolerance"))
    section.plot(plot)
    return section


def _nearest(recorded: Recorded, seen: Approach) -> int:
    """When (ns) the magnet was nearest to the board's centre in the attempt."""
    chosen = recorded.during(seen.t) & np.isfinite(seen.magnet).all(axis=1)
    if not chosen.any():
        return int(seen.t[-1])
    return int(seen.t[chosen][np.argmin(np.linalg.norm(seen.magnet[chosen], axis=1))])


def _from_above(recorded: Recorded, last: Approach, end: int) -> Markup:
    """View along the normal, from the vehicle's side: up-slope is up, the board's left is left."""
    plane = Plane(
        (-_REACH, _REACH), (-_REACH, _REACH), width=520, max_height=430, name="Touchdown seen along the normal"
    )
    plane.axes("y, to the board's left (m)", "x, up-slope (m)", mirrored=True)
    half = recorded.board_size / 2
    plane.polygon([(-half, -half), (half, -half), (half, half), (-half, half)], "fill:#f3ece3;stroke:#a0662f")
    tolerance = recorded.tolerance.distance
    plane.circle(0, 0, tolerance, "fill:rgba(18,128,92,.10);stroke:#12805c;stroke-dasharray:5 3", tip="tolerance")
    plane.note(0, -tolerance, f"tolerance {tolerance:g} m", dx=0, dy=13, anchor="middle", colour="#12805c")
    x, y = last.magnet[:, 0], last.magnet[:, 1]
    footprint = recorded.contact_geometry[1]
    angle = np.linspace(0, 2 * np.pi, 49)[:-1, None]
    disc = last.magnet[-1] + footprint * (np.cos(angle) * last.forward[-1] + np.sin(angle) * last.left[-1])
    plane.polygon([(-p[1], p[0]) for p in disc], f"fill:rgba(18,89,168,.12);stroke:{VEHICLE}")
    nose = last.magnet[-1] + footprint * last.forward[-1]
    plane.path([-y[-1], -nose[1]], [x[-1], nose[0]], f"stroke:{VEHICLE};stroke-width:1.5")
    plane.path(-y, x, f"stroke:{VEHICLE};stroke-width:2")
    for before in (750, 500, 250, 100):
        i = int(np.searchsorted(last.t, end - before * 1_000_000))
        if 0 < i < len(x) and max(abs(x[i]), abs(y[i])) < _REACH:
            plane.dot(-y[i], x[i], 3, f"fill:#fff;stroke:{VEHICLE}", tip=f"{before} ms before")
            plane.note(-y[i], x[i], f"−{before} ms", dx=7, dy=4, colour=VEHICLE)
    plane.dot(-y[-1], x[-1], 5, f"fill:{VEHICLE};stroke:#fff", tip=f"magnet at x {x[-1]:.3f}, y {y[-1]:.3f} m")
    return plane.svg()


def _from_the_side(recorded: Recorded, last: Approach, end: int) -> Markup:
    x, height = last.magnet[:, 0], last.magnet[:, 2]
    shown = (np.abs(x) < 1.6) & (height < 1.2)
    first = int(np.argmax(shown)) if shown.any() else 0
    x, height = x[first:], height[first:]
    low, high = min(-0.3, float(x.min())) - 0.15, max(0.3, float(x.max())) + 0.15
    top = max(0.45, float(height.max()) + 0.15)
    plane = Plane(
        (low, high),
        (min(-0.12, float(height.min()) - 0.1), top),
        width=520,
        max_height=430,
        name="Touchdown from the side",
    )
    plane.axes("x, up-slope (m)", "over the board (m)")
    half, footprint = recorded.board_size / 2, recorded.contact_geometry[1]
    plane.polygon([(-half, 0), (half, 0), (half, -0.02), (-half, -0.02)], f"fill:#c9a47a;stroke:{BOARD}")
    tolerance = recorded.tolerance.distance
    plane.path([-tolerance, tolerance], [0, 0], "stroke:#12805c;stroke-width:4")
    for moment in range(end, end - _BEFORE_NS, -_GHOST_NS):
        i = int(np.searchsorted(last.t, moment, side="right")) - 1
        if i < first:
            break
        centre, arm = last.magnet[i], footprint * last.forward[i]
        colour, wide = (VEHICLE, 3) if moment == end else (MUTED, 1.5)
        plane.path(
            [centre[0] - arm[0], centre[0] + arm[0]],
            [centre[2] - arm[2], centre[2] + arm[2]],
            f"stroke:{colour};stroke-width:{wide}",
        )
    plane.path(x, height, f"stroke:{VEHICLE};stroke-width:1.5")
    plane.dot(x[-1], height[-1], 5, f"fill:{VEHICLE};stroke:#fff")
    return plane.svg()


def _caption(recorded: Recorded) -> Markup:
    below, footprint = recorded.contact_geometry
    return Markup(
        '<p class="small">First: along the normal, from the side the vehicle comes from. Second: from the side, '
        "with the vehicle's outline every 100 ms. "
        "Both move with the board; path of the magnet ({} m below the centre of mass) over "
        "the last second, footprint of {} m radius. Poses: {} and {}.</p>"
    ).format(f"{below:g}", f"{footprint:g}", recorded.vehicle_source, recorded.board_source)
