"""Paths of the board as kernels over one parameter u, and builders of their parameter rows.

A path row (groundcar.motion.path_row) holds where the path frame is in the world and the numbers of its kind.
Paths are those of the paper's appendix "Trajectory Definitions and Parameters", plus a circle.

| kind | u | one lap |
|---|---|---|
| STATIC | unused | 1 |
| LINE | phase, x = SIZE sin(u): the car reverses, its heading stays | 2 pi |
| RACETRACK | arc length, m; 0 is the start of the lower straight, counter-clockwise | 2 LENGTH + 2 pi SIZE |
| FIGURE8 | angle of the lemniscate | 2 pi |
| SPLINE | knots, periodic uniform cubic B-spline over COUNT control points | COUNT |
| ARC | angle driven, rad; TURN +1 counter-clockwise, -1 clockwise | 2 pi |
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import path_row
from groundcar.motion.splines import spline_eval
from kernel.jit import njit

STATIC, LINE, RACETRACK, FIGURE8, SPLINE, ARC = range(6)
KINDS = {"static": STATIC, "line": LINE, "racetrack": RACETRACK, "figure8": FIGURE8, "spline": SPLINE, "arc": ARC}


@njit
def _racetrack(radius, straight, u):
    arc = math.pi * radius
    s = u - (2.0 * (straight + arc)) * math.floor(u / (2.0 * (straight + arc)))
    side = 1.0  # the second half of a lap is the first one turned by half a turn
    if s >= straight + arc:
        s -= straight + arc
        side = -1.0
    if s < straight:
        return side * (s - 0.5 * straight), -side * radius, side, 0.0, 0.0, 0.0
    angle = (s - straight) / radius - 0.5 * math.pi
    c, n = math.cos(angle), math.sin(angle)
    return (
        side * (0.5 * straight + radius * c),
        side * radius * n,
        -side * n,
        side * c,
        -side * c / radius,
        -side * n / radius,
    )


@njit
def _figure8(a, u):
    c, s = math.cos(u), math.sin(u)
    d = 1.0 + s * s
    n, m = s * (s * s - 3.0), 1.0 - 3.0 * s * s
    slope = 2.0 * s * c
    return (
        a * c / d,
        a * s * c / d,
        a * n / (d * d),
        a * m / (d * d),
        a * (-3.0 * c * c * c * d - 2.0 * n * slope) / (d * d * d),
        a * (-6.0 * s * c * d - 2.0 * m * slope) / (d * d * d),
    )


@njit
def path_eval(kind, params, u):
    """(x, y, dx, dy, ddx, ddy) in the world at `u`; derivatives with respect to u (m per unit of u).

    `params` is a path row. u may lie outside the first lap. STATIC and an unknown kind have zero derivatives.
    """
    x = y = dx = dy = ddx = ddy = 0.0
    if kind == SPLINE:
        x, y, dx, dy, ddx, ddy = spline_eval(params, u)
    elif kind == LINE:
        s = params[path_row.SIZE] * math.sin(u)
        x, dx, ddx = s, params[path_row.SIZE] * math.cos(u), -s
    elif kind == RACETRACK:
        x, y, dx, dy, ddx, ddy = _racetrack(params[path_row.SIZE], params[path_row.LENGTH], u)
    elif kind == FIGURE8:
        x, y, dx, dy, ddx, ddy = _figure8(params[path_row.SIZE], u)
    elif kind == ARC:
        x, s = params[path_row.SIZE] * math.cos(u), params[path_row.SIZE] * math.sin(u)
        y, dx, dy, ddx, ddy = params[path_row.TURN] * s, -s, params[path_row.TURN] * x, -x, -params[path_row.TURN] * s
    c, s = params[path_row.COS], params[path_row.SIN]
    return (
        params[path_row.X0] + c * x - s * y,
        params[path_row.Y0] + s * x + c * y,
        c * dx - s * dy,
        s * dx + c * dy,
        c * ddx - s * ddy,
        s * ddx + c * ddy,
    )


@njit
def path_lap(kind, params):
    """How much u grows in one lap: a lap fraction f starts at u = f path_lap(kind, params)."""
    if kind == STATIC:
        return 1.0
    if kind == RACETRACK:
        return 2.0 * params[path_row.LENGTH] + 2.0 * math.pi * params[path_row.SIZE]
    if kind == SPLINE:
        return params[path_row.COUNT]
    return 2.0 * math.pi


@njit
def path_curvature(dx, dy, ddx, ddy):
    """Signed curvature (1/m, left positive) from derivatives; 0 where the path stands still."""
    squared = dx * dx + dy * dy
    if squared < 1e-18:
        return 0.0
    return (dx * ddy - dy * ddx) / (squared * math.sqrt(squared))


def _row(x: float, y: float, heading: float) -> np.ndarray:
    if not all(map(math.isfinite, (x, y, heading))):
        raise ValueError(f"a path's origin and heading must be finite, not ({x}, {y}, {heading})")
    row = np.zeros(path_row.DIM)
    row[path_row.X0], row[path_row.Y0], row[path_row.HEADING], row[path_row.COS], row[path_row.SIN] = (
        x,
        y,
        heading,
        math.cos(heading),
        math.sin(heading),
    )
    return row


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be a positive number of metres, not {value}")
    return value


def static_path(x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> np.ndarray:
    """Path row of a board that stands at (x, y) m, facing `heading` rad. Raises ValueError if not finite."""
    return _row(x, y, heading)


def line_path(amplitude: float = 12.0, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> np.ndarray:
    """Path row of the reciprocating line about (x, y) m along `heading` rad (paper: amplitude 12 m)."""
    row = _row(x, y, heading)
    row[path_row.SIZE] = _positive("the line's amplitude", amplitude)
    return row


def racetrack_path(
    radius: float = 4.0, straight: float = 4.0, x: float = 0.0, y: float = 0.0, heading: float = 0.0
) -> np.ndarray:
    """Path row of two straights and two semicircles centred on (x, y) m (paper: 4 m, 4 m)."""
    row = _row(x, y, heading)
    row[path_row.SIZE], row[path_row.LENGTH] = (
        _positive("the racetrack's radius", radius),
        _positive("the straight", straight),
    )
    return row


def figure8_path(scale: float = 4.0, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> np.ndarray:
    """Path row of the lemniscate centred on (x, y) m (paper: 4 m)."""
    row = _row(x, y, heading)
    row[path_row.SIZE] = _positive("the figure-8's scale", scale)
    return row


def arc_path(radius: float, turn: int = 1, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> np.ndarray:
    """Path row of a circle about (x, y) m, to the left (`turn` 1) or to the right (-1); u = 0 lies along `heading`."""
    if turn not in (-1, 1):
        raise ValueError(f"turn must be 1 (left) or -1 (right), not {turn}")
    row = _row(x, y, heading)
    row[path_row.SIZE], row[path_row.TURN] = _positive("the circle's radius", radius), turn
    return row


def spline_path(controls: np.ndarray, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> np.ndarray:
    """Path row of a closed B-spline over control points (n, 2) m, 4 <= n <= MAX_CONTROL. Raises ValueError."""
    controls = np.asarray(controls, dtype=np.float64)
    if controls.ndim != 2 or controls.shape[1] != 2 or not 4 <= len(controls) <= path_row.MAX_CONTROL:
        raise ValueError(f"control points must have shape (4..{path_row.MAX_CONTROL}, 2), not {controls.shape}")
    if not np.isfinite(controls).all():
        raise ValueError("control points must be finite")
    row = _row(x, y, heading)
    row[path_row.COUNT] = len(controls)
    row[path_row.CONTROL : path_row.CONTROL + 2 * len(controls)] = controls.ravel()
    return row
