import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.motion import path_row
from groundcar.motion import paths as t
from groundcar.motion.paths import path_curvature, path_eval, path_lap


def controls(seed):
    rng = np.random.default_rng(seed)
    angle = 2 * math.pi * np.arange(12) / 12
    return (rng.uniform(2, 9, 12) * np.array([np.cos(angle), np.sin(angle)])).T


PATHS = [
    (t.LINE, t.line_path(12.0, 1.0, -2.0, 0.7)),
    (t.RACETRACK, t.racetrack_path(4.0, 4.0, 0.5, 1.0, -1.1)),
    (t.FIGURE8, t.figure8_path(4.0, -1.0, 2.0, 2.0)),
    (t.SPLINE, t.spline_path(controls(3), 3.0, 1.0, 0.4)),
    (t.ARC, t.arc_path(3.0, 1, 1.0, 1.0, 0.3)),
    (t.ARC, t.arc_path(3.0, -1, 1.0, 1.0, 0.3)),
]


JOINTS = {t.RACETRACK: (0.0, 4.0, 4.0 + 4 * math.pi, 8.0 + 4 * math.pi, 8.0 + 8 * math.pi), t.SPLINE: range(13)}


def off_joints(kind, row, u):
    """`u`, moved a little where the second derivative jumps (racetrack) or has a corner (spline knots)."""
    near = any(abs(joint - u % path_lap(kind, row)) < 1e-3 for joint in JOINTS.get(kind, ()))
    return u + 3e-3 if near else u


@pytest.mark.parametrize(("kind", "row"), PATHS)
@settings(max_examples=60)
@given(u=st.floats(-50, 50))
def test_path_derivatives_agree_with_differences_of_the_position(kind, row, u):
    h, u = 1e-4, off_joints(kind, row, u)
    here, ahead, behind = (np.array(path_eval(kind, row, v)) for v in (u, u + h, u - h))
    first, second = (ahead - behind) / (2 * h), (ahead[2:4] - behind[2:4]) / (2 * h)
    assert here[2:4] == pytest.approx(first[:2], abs=1e-5)
    assert here[4:6] == pytest.approx(second, abs=1e-4)


@pytest.mark.parametrize(("kind", "row"), PATHS)
@settings(max_examples=40)
@given(u=st.floats(-30, 30))
def test_lap_of_a_closed_path_ends_at_its_start(kind, row, u):
    u = off_joints(kind, row, u)
    again = path_eval(kind, row, u + path_lap(kind, row))
    assert path_eval(kind, row, u) == pytest.approx(again, abs=1e-9)


def test_line_path_agrees_with_the_paper():
    row = t.line_path(12.0)
    for phase in np.linspace(-4, 4, 33):
        x, y, *_ = path_eval(t.LINE, row, phase)
        assert (x, y) == pytest.approx((12 * math.sin(phase), 0.0))


def test_racetrack_has_the_paper_s_geometry():
    row = t.racetrack_path()
    assert path_lap(t.RACETRACK, row) == pytest.approx(8 + 8 * math.pi)
    points = np.array([path_eval(t.RACETRACK, row, u)[:2] for u in np.linspace(0, path_lap(t.RACETRACK, row), 2001)])
    assert np.abs(points).max(axis=0) == pytest.approx([6.0, 4.0], abs=1e-4)
    beside = np.abs(points[:, 0]) <= 2
    assert np.abs(points[beside, 1]) == pytest.approx(4.0)
    centre = np.where(points[:, 0] > 0, 2.0, -2.0)
    assert np.hypot(points[~beside, 0] - centre[~beside], points[~beside, 1]) == pytest.approx(4.0)
    for u in np.linspace(0, 40, 57):
        _, _, dx, dy, ddx, ddy = path_eval(t.RACETRACK, row, u)
        assert math.hypot(dx, dy) == pytest.approx(1.0)
        assert path_curvature(dx, dy, ddx, ddy) == pytest.approx(0.25) or (ddx, ddy) == (0.0, 0.0)


def test_figure8_is_the_paper_s_lemniscate():
    row = t.figure8_path(4.0)
    for u in np.linspace(0, 2 * math.pi, 41):
        x, y, dx, dy, *_ = path_eval(t.FIGURE8, row, u)
        assert x == pytest.approx(4 * math.cos(u) / (1 + math.sin(u) ** 2))
        assert y == pytest.approx(4 * math.sin(u) * math.cos(u) / (1 + math.sin(u) ** 2))
        assert math.hypot(dx, dy) == pytest.approx(4 / math.sqrt(1 + math.sin(u) ** 2))
        assert (x * x + y * y) ** 2 == pytest.approx(16 * (x * x - y * y), abs=1e-9)


def test_a_regular_polygon_of_controls_gives_nearly_a_circle():
    angle = 2 * math.pi * np.arange(12) / 12
    row = t.spline_path(5 * np.array([np.cos(angle), np.sin(angle)]).T)
    at_knot = 5 * (4 + 2 * math.cos(math.pi / 6)) / 6
    for u in np.linspace(0, 12, 97):
        x, y, *_ = path_eval(t.SPLINE, row, u)
        assert math.hypot(x, y) == pytest.approx(at_knot, rel=2e-3)


def test_turn_of_an_arc():
    for turn in (1, -1):
        _, _, dx, dy, ddx, ddy = path_eval(t.ARC, t.arc_path(2.5, turn), 0.8)
        assert path_curvature(dx, dy, ddx, ddy) == pytest.approx(turn / 2.5)


def test_origin_and_heading_move_any_path_rigidly():
    for kind, row in PATHS:
        plain = row.copy()
        plain[[path_row.X0, path_row.Y0, path_row.HEADING, path_row.COS, path_row.SIN]] = (0, 0, 0, 1, 0)
        c, s = row[path_row.COS], row[path_row.SIN]
        for u in np.linspace(0, 6, 7):
            x, y, dx, dy, *_ = path_eval(kind, plain, u)
            moved = path_eval(kind, row, u)
            assert moved[:2] == pytest.approx((row[path_row.X0] + c * x - s * y, row[path_row.Y0] + s * x + c * y))
            assert moved[2:4] == pytest.approx((c * dx - s * dy, s * dx + c * dy))


def test_static_path_does_not_move():
    row = t.static_path(3.0, -1.0, 2.0)
    assert path_eval(t.STATIC, row, 5.0) == (3.0, -1.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "build",
    [
        lambda: t.line_path(0.0),
        lambda: t.racetrack_path(radius=math.nan),
        lambda: t.arc_path(3.0, turn=0),
        lambda: t.static_path(math.inf),
        lambda: t.spline_path(np.zeros((3, 2))),
        lambda: t.spline_path(np.full((12, 2), math.nan)),
    ],
)
def test_invalid_arguments_are_refused(build):
    with pytest.raises(ValueError, match=r"must|turn"):
        build()
