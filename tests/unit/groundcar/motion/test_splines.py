import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.motion import path_row
from groundcar.motion.paths import SPLINE, path_curvature, path_eval, static_path
from groundcar.motion.splines import max_curvature, random_spline
from kernel.jit import njit
from kernel.random import stream, uniform


@njit(cache=False)  # a cache beside a test would not notice changed kernels
def sampled_curvature(row, n):
    worst = 0.0
    for k in range(n):
        _, _, dx, dy, ddx, ddy = path_eval(SPLINE, row, row[path_row.COUNT] * k / n)
        worst = max(worst, abs(path_curvature(dx, dy, ddx, ddy)))
    return worst


def drawn(seed, v_des, **options):
    row = static_path()
    alpha = random_spline(stream(seed), row, v_des, **options)
    return row, alpha


@settings(max_examples=150)
@given(seed=st.integers(0, 10**6), v_des=st.floats(0.0, 3.5))
def test_curvature_keeps_the_board_s_turn_rate_within_the_limit(seed, v_des):
    row, _ = drawn(seed, v_des)
    assert sampled_curvature(row, 12_000) <= 1.2 / max(v_des, 0.1) * 1.001


def test_the_largest_curvature_is_found():
    for seed in range(200):
        row, _ = drawn(seed, 0.0)
        assert max_curvature(row) == pytest.approx(sampled_curvature(row, 24_000), rel=1e-3)


def test_control_points_are_at_even_angles_within_the_published_radii():
    seen = []
    for seed in range(300):
        row, alpha = drawn(seed, 0.5)
        points = row[path_row.CONTROL : path_row.CONTROL + 24].reshape(12, 2)
        angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
        assert np.diff(angles) == pytest.approx(2 * math.pi / 12)
        radii = np.hypot(*points.T)
        assert 1.0 <= radii.min() <= radii.max() <= 12.0
        seen.append(radii)
        assert 0.0 <= alpha <= 1.0
    assert np.mean(seen) == pytest.approx(6.5, abs=0.2)
    assert np.std(seen) > 1.0  # far from a circle at low speed


def test_radii_are_draws_smoothed_around_the_circle():
    row, alpha = drawn(11, 0.1)
    rng = stream(11)
    raw = np.array([uniform(rng, 1.0, 12.0) for _ in range(12)])
    assert alpha == 1.0
    smoothed = (np.roll(raw, 1) + 2 * raw + np.roll(raw, -1)) / 4
    assert np.hypot(*row[path_row.CONTROL : path_row.CONTROL + 24].reshape(12, 2).T) == pytest.approx(smoothed)


def test_shrinking_is_by_one_factor_about_the_mean():
    slow, alpha_slow = drawn(5, 0.1)
    fast, alpha = drawn(5, 2.5)
    assert alpha_slow == 1.0
    assert 0.0 < alpha < 1.0
    r_slow, r_fast = (np.hypot(*r[path_row.CONTROL : path_row.CONTROL + 24].reshape(12, 2).T) for r in (slow, fast))
    assert r_fast - r_fast.mean() == pytest.approx(alpha * (r_slow - r_slow.mean()))
    assert r_fast.mean() == pytest.approx(r_slow.mean())


def test_the_shrinking_is_not_more_than_needed():
    shrunk = [(row, alpha) for row, alpha in (drawn(seed, 2.5) for seed in range(100)) if 0.0 < alpha < 1.0]
    assert len(shrunk) > 20
    assert np.median([max_curvature(row) for row, _ in shrunk]) > 0.98 * 1.2 / 2.5


def test_a_circle_that_is_too_tight_is_widened():
    row, alpha = drawn(1, 10.0, r_min=1.0, r_max=3.0)
    assert alpha == 0.0
    assert max_curvature(row) == pytest.approx(0.12, rel=1e-6)


def test_equal_streams_give_equal_splines_and_do_not_move_the_origin():
    a, b = static_path(4.0, 5.0, 0.3), static_path(4.0, 5.0, 0.3)
    random_spline(stream(7), a, 2.0)
    random_spline(stream(7), b, 2.0)
    assert np.array_equal(a, b)
    assert list(a[:3]) == [4.0, 5.0, 0.3]
    random_spline(stream(8), b, 2.0)
    assert not np.array_equal(a, b)
