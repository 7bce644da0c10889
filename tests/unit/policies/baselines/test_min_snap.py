"""Minimum-snap matrices against what defines them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from policies.baselines.min_snap import BOUNDARY, END, HEAD, PIECES, SAMPLES, WAYPOINTS, basis, min_snap

boundaries = st.lists(st.floats(-3.0, 3.0), min_size=BOUNDARY, max_size=BOUNDARY).map(np.array)


@given(boundaries)
def test_the_motion_passes_through_its_boundary_and_is_smooth_to_the_sixth_derivative(boundary):
    pieces = min_snap().coefficients @ boundary
    for d in range(4):
        assert abs(basis(0.0, d) @ pieces[0] - boundary[HEAD + d]) < 1e-7
        assert abs(basis(1.0, d) @ pieces[-1] - boundary[END + d]) < 1e-7
    for k in range(PIECES - 1):
        assert abs(basis(1.0, 0) @ pieces[k] - boundary[WAYPOINTS + k]) < 1e-7
        for d in range(7):
            assert abs(basis(1.0, d) @ pieces[k] - basis(0.0, d) @ pieces[k + 1]) < 1e-5


@given(boundaries)
def test_energy_is_the_integral_of_squared_snap(boundary):
    curve = min_snap()
    pieces = curve.coefficients @ boundary
    nodes, weights = np.polynomial.legendre.leggauss(5)
    snap = [[basis(0.5 * (u + 1.0), 4) @ piece for u in nodes] for piece in pieces]
    integral = float((np.square(snap) * weights).sum() * 0.5)
    assert np.isclose(boundary @ curve.energy @ boundary, integral, rtol=1e-6, atol=1e-5)


def test_minimum_snap_curve_has_the_least_snap_through_its_points():
    # A bump that vanishes with three derivatives at both ends of a piece keeps way points and continuity up to jerk.
    curve = min_snap()
    boundary = np.random.default_rng(0).normal(size=BOUNDARY)
    pieces = curve.coefficients @ boundary
    nodes, weights = np.polynomial.legendre.leggauss(8)
    u = 0.5 * (nodes + 1.0)
    bump = np.polynomial.Polynomial.fromroots([0.0] * 4 + [1.0] * 4).deriv(4)(u)
    for k in range(PIECES):
        snap = np.array([basis(at, 4) @ pieces[k] for at in u])
        for size in (-1.0, 1.0):
            assert ((snap + size * bump) ** 2 * weights).sum() > (snap**2 * weights).sum()


def test_samples_equal_the_motion_and_its_derivatives():
    curve = min_snap()
    boundary = np.random.default_rng(1).normal(size=BOUNDARY)
    pieces = curve.coefficients @ boundary
    for d in range(4):
        at = 3 * (SAMPLES + 1) + 8
        assert np.isclose(curve.sampled[d, :, at] @ boundary, basis(0.5, d) @ pieces[3])
    assert np.array_equal(curve.by_sample, curve.sampled.transpose(0, 2, 1))
