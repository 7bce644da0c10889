import math

import numpy as np
import pytest

from policies.prediction import coast_row
from policies.prediction.coast import coast_future, coast_keep, coast_state, coasting
from policies.prediction.future import HORIZON, STEP, predict_future


def kept(speed=2.0, turn_rate=0.5, t=10.0, age=0.02):
    future, row = np.zeros((HORIZON, 8)), np.zeros(coast_row.DIM)
    predict_future(np.array([1.0, -2.0, 1.5, 0.3, speed, turn_rate, 0.9, 0.0]), 0.5, STEP, future)
    coast_keep(row, t, age, future)
    return row, future


def test_coasting_starts_after_a_gap_and_ends_after_its_limit():
    row, _ = kept(t=10.0)
    assert not coasting(np.zeros(coast_row.DIM), 10.5, 0.5)
    assert not coasting(row, 10.1, 0.02)
    assert coasting(row, 10.1, 0.12)
    assert not coasting(row, 13.0, 3.0)


def test_prediction_from_an_old_exposure_is_not_kept():
    row, _ = kept(age=0.08)
    assert not row.any()


def test_coasted_board_equals_the_kept_prediction():
    row, future = kept()
    x = np.zeros(8)
    coast_state(row, 10.0 + 7 * STEP, STEP, x)
    np.testing.assert_allclose(x[:7], future[7, :7], atol=1e-12)
    assert x[7] == pytest.approx(0.0, abs=1e-9)


def test_a_rising_speed_gives_an_acceleration():
    row, future = kept()
    future[:, 4] = 1.0 + 1.5 * STEP * np.arange(HORIZON)
    coast_keep(row, 10.0, 0.0, future)
    x = np.zeros(8)
    coast_state(row, 10.33, STEP, x)
    assert x[4] == pytest.approx(1.0 + 1.5 * 0.33)
    assert x[7] == pytest.approx(1.5)


def test_coasted_future_extrapolates_beyond_the_kept_rows():
    row, future = kept(speed=2.0, turn_rate=0.5)
    later = np.zeros((HORIZON, 8))
    coast_future(row, 11.0, STEP, later)
    np.testing.assert_allclose(later[:40, :7], future[20:60, :7], atol=1e-9)
    step = np.hypot(*(later[-1, :2] - later[-2, :2]))
    assert step == pytest.approx(2.0 * STEP, rel=1e-3)
    assert math.remainder(later[-1, 3] - later[-2, 3], 2 * math.pi) == pytest.approx(0.5 * STEP, rel=1e-3)
