"""The gradient against differences, and the penalties where they should and should not act."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.baselines import carried_row, variables_row
from policies.baselines import fast_perching_cost as fp
from policies.baselines.fast_perching_params import FastPerchingParams
from policies.baselines.min_snap import PIECES, min_snap
from policies.baselines.smoothing import piece_seconds, piece_variable

PARAMS = FastPerchingParams(thrust_min=4.8, thrust_max=14.8, contact_below=0.02, contact_radius=0.13)
ROW = PARAMS.row()


def cost(x, start, board):
    gradient = np.zeros(variables_row.DIM)
    return fp.cost_and_gradient(x, start, board, ROW, *min_snap()[1:], gradient), gradient


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(-1.0, 1.0), st.floats(0.0, 1.4))
def test_gradient_agrees_with_differences_of_the_cost(seed, turn_rate, inclination):
    rng = np.random.default_rng(seed)
    board = np.array([1.0, 0.5, 1.5, 0.3, 2.0, turn_rate, inclination, 0.0])
    start = rng.normal(size=(4, 3)) + np.array([0.0, 0.0, 1.5]) * (np.arange(4) == 0)[:, None]
    x = 0.5 * rng.normal(size=variables_row.DIM)
    for k in range(1, PIECES):
        x[3 * k - 2 : 3 * k + 1] += start[0] + (np.array([3.0, 1.5, 1.5]) - start[0]) * k / PIECES
    _, gradient = cost(x, start, board)
    step, measured = 2e-7, np.zeros(variables_row.DIM)  # a longer one errs by the cost's curvature
    for i in range(variables_row.DIM):
        ahead, back = x.copy(), x.copy()
        ahead[i], back[i] = ahead[i] + step, back[i] - step
        measured[i] = (cost(ahead, start, board)[0] - cost(back, start, board)[0]) / (2.0 * step)
    assert np.abs(gradient - measured).max() < 1e-5 * np.abs(measured).max()


@given(st.floats(-20.0, 20.0))
def test_piece_durations_are_positive_and_invertible(t):
    seconds, slope = piece_seconds(t)
    assert seconds > 0.0
    assert slope > 0.0
    assert piece_variable(seconds) == pytest.approx(t, abs=1e-9)


def test_speed_above_the_limit_costs_and_hover_does_not():
    now = np.zeros(carried_row.DIM)
    now[:3], now[carried_row.NORMAL + 2] = (5.0, 0.0, 1.5), 1.0
    hover = np.zeros((4, 3))
    hover[0] = 0.0, 0.0, 2.0
    assert fp.sample_cost(hover, now, ROW, np.zeros((4, 3)))[0] == 0.0
    fast, gradient = hover.copy(), np.zeros((4, 3))
    fast[1, 0] = PARAMS.speed_max + 0.5
    assert fp.sample_cost(fast, now, ROW, gradient)[0] == pytest.approx(1e3 * ((6.5**2 - 36.0) - 0.005))
    assert gradient[1, 0] > 0.0


def test_leaning_body_collides_with_the_board_where_an_upright_one_does_not():
    now = np.zeros(carried_row.DIM)
    now[carried_row.NORMAL + 2] = 1.0
    upright = np.zeros((4, 3))
    upright[0, 2] = 0.4 + PARAMS.contact_below
    now[carried_row.POSITION + 2] = 0.4
    assert fp.sample_cost(upright, now, ROW, np.zeros((4, 3)))[0] == 0.0
    leaning = upright.copy()
    leaning[2] = 5.0, 0.0, 0.0
    assert fp.sample_cost(leaning, now, ROW, np.zeros((4, 3)))[0] > 0.0


@given(st.floats(-1.5, 1.5), st.floats(0.0, 3.0))
def test_board_is_predicted_on_its_circle(turn_rate, t):
    board, out, later = (
        np.array([1.0, 2.0, 1.5, 0.4, 1.8, turn_rate, 0.7, 0.0]),
        np.zeros(carried_row.DIM),
        np.zeros(carried_row.DIM),
    )
    fp.board_at(board, t, out)
    fp.board_at(board, t + 1e-5, later)
    assert np.allclose((later[:3] - out[:3]) / 1e-5, out[3:6], atol=1e-3)
    triad = out[carried_row.NORMAL : carried_row.TURN].reshape(3, 3)
    assert np.allclose(triad @ triad.T, np.eye(3), atol=1e-9)
    assert out[carried_row.NORMAL + 2] == pytest.approx(math.cos(0.7))
