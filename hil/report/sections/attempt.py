"""The attempt in the world: 3-D, plan and side view of vehicle and board."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from hil.report.drawing.charts import BOARD, MUTED, SEEN, VEHICLE
from hil.report.drawing.section import Section
from hil.report.drawing.svg import Plane
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import Motion, at, axes
from hil.report.sections.scene import scene

_MARK_NS = 250_000_000
_MOST_POINTS, _MOST_DOTS, _MOST_MARKS = 4000, 1500, 200


def build(recorded: Recorded) -> Section:
    section = Section("attempt", "The attempt, in the world")
    if not section.needs_pose(recorded, "plan and side view", board=False):
        return section
    assert recorded.vehicle is not None
    start, end = recorded.window_ns
    vehicle = _cut(recorded.vehicle, start, recorded.decided_ns or end)
    board = _cut(recorded.board, start, recorded.decided_ns or end) if recorded.board else None
    if vehicle is None:
        section.lost.append(("plan and side view", f"{recorded.vehicle_source} has no sample in the attempt"))
        return section
    if board is None:
        section.lost.append(("the board in plan and side view", "no board pose in the attempt"))
    section.html(scene(recorded, vehicle, board))
    along = _direction(vehicle, board)
    seen = _seen(recorded, vehicle)
    across = np.array([0.0, 0.0, 1.0])
    east, north = np.eye(3)[:2]
    section.html(
        Markup('<div class="pair">{}{}</div>').format(
            _view(recorded, vehicle, board, seen, east, north, ("east (m)", "north (m)"), "Plan view"),
            _view(recorded, vehicle, board, seen, along, across, ("along the attempt (m)", "height (m)"), "Side view"),
        )
    )
    heading = np.degrees(np.arctan2(along[1], along[0]))
    section.html(
        Markup(
            '<p class="small">First: from above. Second: from the side, looking across the direction of {}° from east. '
            '<b style="color:{}">vehicle</b> with its camera\'s side as a tick every {} ms, '
            '<b style="color:{}">board</b> drawn at start and end, '
            '<b style="color:{}">dots</b> where a picture showed the board. Poses: {}.</p>'
        ).format(
            f"{heading:.0f}",
            VEHICLE,
            _mark_ns(vehicle) // 1_000_000,
            BOARD,
            SEEN,
            ", ".join(filter(None, (recorded.vehicle_source, recorded.board_source))),
        )
    )
    return section


def _mark_ns(vehicle: Motion) -> int:
    """Time between ticks on the path: a quarter of a second, longer in an attempt of minutes."""
    return _MARK_NS * (1 + int(vehicle.t[-1] - vehicle.t[0]) // _MARK_NS // _MOST_MARKS)


def _cut(motion: Motion, start: int, end: int) -> Motion | None:
    keep = (motion.t >= start) & (motion.t <= end)
    chosen = np.flatnonzero(keep)
    chosen = chosen[:: max(1, len(chosen) // _MOST_POINTS)]
    return Motion(*(part[chosen] for part in motion)) if len(chosen) > 1 else None


def _direction(vehicle: Motion, board: Motion | None) -> np.ndarray:
    """Horizontal unit vector from the vehicle's start to the attempt's end: the side view's horizontal axis."""
    goal = board.position[-1] if board else vehicle.position[-1]
    way = (goal - vehicle.position[0]) * (1.0, 1.0, 0.0)
    length = float(np.linalg.norm(way))
    return way / length if length > 0.1 else np.array([1.0, 0.0, 0.0])


def _seen(recorded: Recorded, vehicle: Motion) -> np.ndarray:
    """Where the vehicle was when a picture showed the board, (n, 3) m."""
    detections = recorded.topics.get("board/detection")
    if detections is None:
        return np.empty((0, 3))
    exposed = detections.nanoseconds()[detections["found"] > 0]
    exposed = exposed[(exposed >= vehicle.t[0]) & (exposed <= vehicle.t[-1])]
    exposed = exposed[:: 1 + len(exposed) // _MOST_DOTS]
    where = at(vehicle, exposed).position if len(exposed) else np.empty((0, 3))
    return where[np.isfinite(where).all(axis=1)]


def _view(
    recorded: Recorded,
    vehicle: Motion,
    board: Motion | None,
    seen: np.ndarray,
    right: np.ndarray,
    up: np.ndarray,
    labels: tuple[str, str],
    name: str,
) -> Markup:
    paths = [vehicle.position] + ([board.position] if board else [])
    h, v = (np.concatenate([p @ axis for p in paths]) for axis in (right, up))
    margin = 0.35
    low = min(0.0, float(v.min())) if up[2] > 0 else float(v.min()) - margin
    size_v = max(float(v.max()) + margin, low + 1.0)
    plane = Plane(
        (float(h.min()) - margin, float(h.max()) + margin), (low, size_v), width=520, max_height=430, name=name
    )
    plane.axes(*labels)
    if board:
        plane.path(board.position @ right, board.position @ up, f"stroke:{BOARD};stroke-width:1.5;stroke-dasharray:5 3")
        for i, colour in ((0, MUTED), (-1, BOARD)):
            _board(plane, recorded.board_size, board, i, right, up, colour)
    plane.path(vehicle.position @ right, vehicle.position @ up, f"stroke:{VEHICLE};stroke-width:2")
    forward = axes(vehicle.orientation)[:, :, 0]
    for moment in range(int(vehicle.t[0]), int(vehicle.t[-1]), _mark_ns(vehicle)):
        i = int(np.searchsorted(vehicle.t, moment))
        tip = vehicle.position[i] + 18 / plane.scale * forward[i]
        plane.path(
            [vehicle.position[i] @ right, tip @ right], [vehicle.position[i] @ up, tip @ up], f"stroke:{VEHICLE}"
        )
    for p in seen:
        plane.dot(p @ right, p @ up, 2, f"fill:{SEEN}")
    plane.dot(vehicle.position[0] @ right, vehicle.position[0] @ up, 4, f"fill:#fff;stroke:{VEHICLE}", tip="start")
    plane.note(vehicle.position[0] @ right, vehicle.position[0] @ up, "start", colour=VEHICLE)
    plane.dot(vehicle.position[-1] @ right, vehicle.position[-1] @ up, 4, f"fill:{VEHICLE};stroke:#fff", tip="end")
    return plane.svg()


def _board(plane: Plane, size: float, board: Motion, i: int, right: np.ndarray, up: np.ndarray, colour: str) -> None:
    x, y, _ = axes(board.orientation)[i].T
    corners = [board.position[i] + size / 2 * (a * x + b * y) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    plane.polygon(
        [(float(c @ right), float(c @ up)) for c in corners],
        f"fill:rgba(194,87,12,.15);stroke:{colour};stroke-width:1.5",
    )
