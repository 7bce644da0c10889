"""The attempt in 3-D, as lines that the page's script rotates."""

from __future__ import annotations

import json

import numpy as np
from markupsafe import Markup

from hil.report.drawing.charts import BOARD, MUTED, VEHICLE
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import Motion, axes

_STEP_NS = 20_000_000  # between drawn points
_ARROW_NS = 200_000_000  # between drawn attitudes
_ARROW_M = 0.3


def scene(recorded: Recorded, vehicle: Motion, board: Motion | None) -> Markup:
    """Paths, shadow on the ground, the vehicle's thrust axis as arrows, the board at start, half-way and end."""
    lines: list[dict[str, object]] = []
    path = _every(vehicle, _STEP_NS)
    _line(lines, path.position * (1, 1, 0), "#c9cdd3", 1)
    _line(lines, path.position, VEHICLE, 2)
    arrows = _every(vehicle, _ARROW_NS)
    for p, up in zip(arrows.position, axes(arrows.orientation)[:, :, 2], strict=True):
        _line(lines, np.array([p, p + _ARROW_M * up]), VEHICLE, 1)
    if board is not None:
        _line(lines, _every(board, _STEP_NS).position, BOARD, 1.5)
        half = recorded.board_size / 2
        for i, colour in ((0, MUTED), (len(board.t) // 2, MUTED), (-1, BOARD)):
            x, y, _ = axes(board.orientation)[i].T
            corners = [
                board.position[i] + half * (a * x + b * y) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1))
            ]
            _line(lines, np.array(corners), colour, 2)
            _line(lines, np.array([board.position[i] * (1, 1, 0), board.position[i]]), "#c9cdd3", 1)
    points = np.concatenate([vehicle.position, *([board.position] if board else [])])
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = 0.0
    heading = np.arctan2(*(path.position[-1] - path.position[0])[1::-1])
    table = {
        "lines": lines,
        "low": low.round(2).tolist(),
        "high": high.round(2).tolist(),
        "azimuth": round(float(heading) + 1.1, 2),  # looking left across the way, so that it runs to the right
    }
    text = json.dumps(table, separators=(",", ":"), allow_nan=False)
    return Markup(
        '<figure class="scene" data-scene="{}"><figcaption><b>In 3-D</b> <span>drag to turn; lines at the vehicle '
        "point along its thrust, every 200 ms; a square of the grid is 1 m</span></figcaption></figure>"
    ).format(text)


def _every(motion: Motion, step_ns: int) -> Motion:
    step_ns = max(step_ns, int(motion.t[-1] - motion.t[0]) // 500)
    wanted = np.arange(int(motion.t[0]), int(motion.t[-1]) + 1, step_ns)
    chosen = np.unique(np.append(np.searchsorted(motion.t, wanted), len(motion.t) - 1))
    return Motion(*(part[chosen] for part in motion))


def _line(lines: list[dict[str, object]], points: np.ndarray, colour: str, width: float) -> None:
    lines.append({"p": points.round(3).tolist(), "c": colour, "w": width})
