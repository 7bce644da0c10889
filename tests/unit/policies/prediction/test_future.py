import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.prediction import future as pr
from policies.prediction import oscillation_row


def truth(t, speed=2.0, turn=0.5):
    x, y = speed / turn * math.sin(turn * t), speed / turn * (1 - math.cos(turn * t))
    return np.array([x, y, 1.5, turn * t, speed, turn, 0.9, 0.0])


@settings(max_examples=30, deadline=None)
@given(st.floats(-2.5, 3.0), st.floats(-1.2, 1.2), st.floats(-3.0, 3.0))
def test_prediction_without_acceleration_is_the_arc(speed, turn, heading):
    out, state = np.zeros((41, 8)), np.array([1.0, 2.0, 1.5, heading, speed, turn, 0.3, 0.0])
    pr.predict_future(state, 1.0, 0.05, out)
    w = turn if abs(turn) > 1e-6 else 1e-6
    assert out[40, 0] == pytest.approx(1 + speed / w * (math.sin(heading + 2 * w) - math.sin(heading)), abs=1e-4)
    assert out[40, 4] == pytest.approx(speed) and np.all(out[:, 7] == 0.0)
    assert out[0, :7] == pytest.approx(state[:7])


def test_acceleration_decays():
    out = np.zeros((64, 8))
    pr.predict_future(np.array([0, 0, 1.5, 0, 1.0, 0, 0, 2.0]), 0.5, 0.05, out)
    assert out[63, 4] == pytest.approx(1 + 2.0 * 0.5, abs=0.01)
    assert out[10, 4] == pytest.approx(1 + 1.0 * (1 - math.exp(-1.0)), abs=1e-6)
    assert np.all(np.diff(out[:, 4]) > 0)


def test_interpolation_is_exact_on_rows_and_extrapolates_after_the_last():
    future, row = np.stack([truth(0.05 * k) for k in range(64)]), np.zeros(8)
    for t in (0.0, 0.5, 3.15):
        pr.board_at(future, 0.05, t, row)
        assert row == pytest.approx(truth(t), abs=1e-9)
    for t in (0.027, 1.333, 3.149):
        pr.board_at(future, 0.05, t, row)
        assert row == pytest.approx(truth(t), abs=1e-5)
    pr.board_at(future, 0.05, 3.5, row)
    assert row == pytest.approx(truth(3.5), abs=1e-3)
    pr.board_at(future, 0.05, -1.0, row)
    assert row[0] == pytest.approx(-2.0, abs=0.2)


def test_headings_are_interpolated_across_pi():
    future, row = np.zeros((3, 8)), np.zeros(8)
    future[:, 3] = (3.12, -3.14, -3.12)
    pr.board_at(future, 0.05, 0.025, row)
    assert abs(row[3]) == pytest.approx(math.pi - 0.01, abs=0.01)


def test_untrusted_fit_is_ignored_and_a_trusted_one_keeps_the_curvature():
    state = np.array([0, 0, 1.5, 0.2, 2.0, 0.6, 0.9, 0.7])
    plain, swung, fit = np.zeros((40, 8)), np.zeros((40, 8)), np.zeros(oscillation_row.DIM)
    pr.predict_future(state, 0.8, 0.05, plain)
    pr.predict_oscillation(state, fit, 0.8, 0.05, swung)
    assert swung[:, 4] == pytest.approx(plain[:, 4], abs=1e-9)
    fit[:4] = (2 * math.pi / 3.0, 0.75, 0.0, 1.0)  # a maximum now
    pr.predict_oscillation(state, fit, 0.8, 0.05, swung)
    assert swung[30, 4] == pytest.approx(2.0 - 1.5, abs=1e-6)  # the minimum half a period later
    assert swung[30, 5] / swung[30, 4] == pytest.approx(0.3, abs=1e-6)
