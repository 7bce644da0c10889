"""The constant parts of the view: shapes, colours, lens and layout, for finished runs and for runs in progress.

World ENU; `world/vehicle/camera` is the pinhole with the pictures. Needs the optional Rerun SDK.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from groundcar.board.layout import Board
from hil.report.drawing.charts import SEEN, VEHICLE

WORLD, BODY, BOARD_AT, BELIEF_AT = "world", "world/vehicle", "world/board", "world/belief"
CAMERA, PLOTS, EVENTS = "world/vehicle/camera", "plots", "events"
ATTEMPT, RUN = "attempt", "run"  # timelines: seconds from the attempt's start, and of the run's clock
LEVELS = {"error": "ERROR", "trip": "ERROR", "warning": "WARN"}


def rgb(colour: str) -> list[int]:
    """#rrggbb as three numbers."""
    return [int(colour[i : i + 2], 16) for i in (1, 3, 5)]


def layout(timeline: str, tabs: Mapping[str, Sequence[tuple[str, str]]]) -> rrb.Blueprint:
    """Scene beside picture and log, plots under them. `tabs`: name -> (key, title) of its plots."""
    grids = []
    for name, plots in tabs.items():
        views = [rrb.TimeSeriesView(origin=f"{PLOTS}/{key}", name=title) for key, title in plots]
        if views:
            grids.append(rrb.Grid(*views, grid_columns=2, name=name))
    scene = rrb.Spatial3DView(origin=WORLD, contents=[f"{WORLD}/**"], name="scene (world, ENU)")
    picture = rrb.Spatial2DView(origin=CAMERA, contents=[f"{CAMERA}/**"], name="camera")
    side = rrb.Vertical(picture, rrb.TextLogView(origin=EVENTS, name="events"), row_shares=[3, 1])
    parts = [rrb.Horizontal(scene, side, column_shares=[3, 2]), *([rrb.Tabs(*grids)] if grids else [])]
    return rrb.Blueprint(
        rrb.Vertical(*parts, row_shares=[3, 2][: len(parts)]),
        rrb.TimePanel(timeline=timeline, expanded=False),
        collapse_panels=True,
    )


def draw_world(stream: rr.RecordingStream) -> None:
    """Which way is up."""
    stream.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)


def draw_arms(stream: rr.RecordingStream) -> None:
    """The vehicle's cross."""
    arms = [[(0.09, 0.09, 0.0), (-0.09, -0.09, 0.0)], [(0.09, -0.09, 0.0), (-0.09, 0.09, 0.0)]]
    stream.log(f"{BODY}/arms", rr.LineStrips3D(arms, colors=rgb(VEHICLE), radii=0.008), static=True)


def draw_board(stream: rr.RecordingStream, side: float, tolerance: float) -> None:
    """Plate, tags and tolerance circle; `side` and `tolerance` (radius) in m."""
    board = Board(size=side)
    plate = rr.Boxes3D(
        sizes=[[side, side, 0.01]], centers=[[0.0, 0.0, -0.005]], colors=[[235, 225, 210]], fill_mode="solid"
    )
    stream.log(f"{BOARD_AT}/plate", plate, static=True)
    corners = [np.vstack([c, c[:1]]) for c in board.corners_by_id.values()]
    strips = [np.column_stack([c[:, :2], np.full(len(c), 0.002)]) for c in corners]
    stream.log(f"{BOARD_AT}/tags", rr.LineStrips3D(strips, colors=[20, 20, 20], radii=0.002), static=True)
    angle = np.linspace(0.0, 2 * np.pi, 61)
    circle = tolerance * np.column_stack([np.cos(angle), np.sin(angle), np.full(61, 0.01)])
    stream.log(f"{BOARD_AT}/tolerance", rr.LineStrips3D([circle], colors=rgb(SEEN), radii=0.003), static=True)


def draw_believed(stream: rr.RecordingStream, side: float) -> None:
    """Outline of the board as the filter believes it, at the stream's time: only once there is a belief."""
    stream.log(
        f"{BELIEF_AT}/outline",
        rr.Boxes3D(sizes=[[side, side, 0.004]], colors=[[123, 63, 160]], labels=["believed"]),
    )


def draw_lens(
    stream: rr.RecordingStream,
    mount: Sequence[float],
    rotation: Sequence[float],
    matrix: np.ndarray,
    size: tuple[int, int],
) -> None:
    """The camera on the vehicle: `mount` (m, body), `rotation` (body from optical, w, x, y, z), intrinsics (3, 3)."""
    turned = rr.Quaternion(xyzw=[rotation[1], rotation[2], rotation[3], rotation[0]])
    stream.log(CAMERA, rr.Transform3D(translation=mount, quaternion=turned), static=True)
    lens = rr.Pinhole(image_from_camera=matrix, resolution=list(size), image_plane_distance=0.5)
    stream.log(CAMERA, lens, static=True)


def draw_corners(stream: rr.RecordingStream, tag_ids: Sequence[int], corners_px: Sequence[float], scale: float) -> None:
    """Outlines of the tags of one picture that was reduced by `scale`; none found wipes them."""
    whole = len(corners_px) // 8 * 8  # a foreign recording may hold anything
    quads = np.asarray(corners_px[:whole], dtype=np.float64).reshape(-1, 4, 2)
    strips = [(np.vstack([quad, quad[:1]]) + 0.5) * scale for quad in quads]
    names = [f"tag {i}" for i in tag_ids][: len(strips)]
    lines = rr.LineStrips2D(strips, colors=rgb(SEEN), labels=names or None, show_labels=False)
    stream.log(f"{CAMERA}/tags", lines if strips else rr.Clear(recursive=False))
