import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from policies.estimation.ctrv import advance_state
from policies.prediction import learned as pd
from policies.prediction import net_row, past_row, scratch_row
from policies.prediction.future import HORIZON, STEP, predict_future


def drive(history, heading=0.3, x=1.0, y=-2.0, speed=1.5, turn=0.4, ticks=300, age=0.05, reflection=1.0):
    """A turning car with an oscillating speed, in a history of 10 ms steps; returns its row now and the time."""
    row = np.array([x, y, 1.5, heading, speed, reflection * turn, 0.5, 0.0])
    for k in range(ticks):
        row[7] = 1.2 * math.sin(2.0 * k * 0.01)
        advance_state(row, 0.01, 1e6)
        pd.predictor_push(history, k * 0.01, row, age)
    return row, (ticks - 1) * 0.01


def random_net(seed=0, gate=(0.3, 0.7, 0.8, 1.6, 0.0), gain=0.05):
    rng = np.random.default_rng(seed)
    shapes = [
        (net_row.INPUTS, net_row.HIDDEN1),
        (net_row.HIDDEN1, net_row.HIDDEN2),
        (net_row.HIDDEN2, net_row.OUTPUTS),
    ]
    return pd.pack_network([(gain * rng.standard_normal(s), gain * rng.standard_normal(s[1])) for s in shapes], gate)


def predict(net, history, row, t, age=0.05):
    future, scratch = np.zeros((HORIZON, 8)), np.zeros(scratch_row.DIM, np.float32)
    predict_future(row, 0.5, STEP, future)
    found = pd.predict_learned(history, t, row, 0.01, 0.1, age, 40.0, STEP, net, scratch, 1.0, future)
    return future, found


@given(st.floats(-3.0, 3.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_prediction_is_equivariant_to_rotation_and_translation(angle, dx, dy):
    one, two, net = np.zeros(pd.HISTORY_DIM), np.zeros(pd.HISTORY_DIM), random_net()
    here, _ = predict(net, one, *drive(one, heading=0.0, x=0.0, y=0.0))
    there, _ = predict(net, two, *drive(two, heading=angle, x=dx, y=dy))
    c, s = math.cos(angle), math.sin(angle)
    np.testing.assert_allclose(there[:, 0] - dx, c * here[:, 0] - s * here[:, 1], atol=2e-4)
    np.testing.assert_allclose(there[:, 1] - dy, s * here[:, 0] + c * here[:, 1], atol=2e-4)
    np.testing.assert_allclose(there[:, 3] - angle, here[:, 3], atol=1e-4)
    np.testing.assert_allclose(there[:, 4:6], here[:, 4:6], atol=1e-4)


def test_rows_agree_with_their_own_speeds_and_turn_rates():
    history = np.zeros(pd.HISTORY_DIM)
    future, (trust, _) = predict(random_net(1), history, *drive(history))
    assert trust == 1.0
    assert np.ptp(future[:, 4]) > 0.01 and np.ptp(future[:, 5]) > 0.01
    moved = np.hypot(*np.diff(future[:, :2], axis=0).T) / STEP
    np.testing.assert_allclose(moved, np.abs(0.5 * (future[1:, 4] + future[:-1, 4])), rtol=2e-3, atol=1e-4)
    np.testing.assert_allclose(np.diff(future[:, 3]) / STEP, 0.5 * (future[1:, 5] + future[:-1, 5]), atol=1e-9)


def test_zero_network_on_a_circle_predicts_the_circle():
    history = np.zeros(pd.HISTORY_DIM)
    row = np.array([0.0, 0.0, 1.5, 0.0, 2.0, 0.8, 0.3, 0.0])
    for k in range(200):
        pd.predictor_push(history, 0.01 * k, row, 0.05)
    future, _ = predict(
        np.append(np.zeros(net_row.DIM - 5), (0.3, 0.7, 0.8, 1.6, 0)).astype(np.float32), history, row, 2
    )
    angle = 0.8 * STEP * np.arange(HORIZON)
    np.testing.assert_allclose(future[:, 0], 2.5 * np.sin(angle), atol=1e-3)
    np.testing.assert_allclose(future[:, 1], 2.5 * (1.0 - np.cos(angle)), atol=1e-3)


@pytest.mark.parametrize(("ticks", "age"), [(20, 0.05), (300, 1.7)])
def test_analytic_rows_are_kept_without_history_or_after_a_long_gap(ticks, age):
    history = np.zeros(pd.HISTORY_DIM)
    row, t = drive(history, ticks=ticks)
    wanted = np.zeros((HORIZON, 8))
    predict_future(row, 0.5, STEP, wanted)
    future, found = predict(random_net(2), history, row, t, age)
    assert found == (0.0, 0.0)
    np.testing.assert_array_equal(future, wanted)


def test_trust_in_the_network_is_continuous():
    history, net, last, row = np.zeros(pd.HISTORY_DIM), random_net(), 0.0, np.zeros(8)
    for k in range(150):
        pd.predictor_push(history, 0.01 * k, row, 0.05)
        trust = pd.predictor_trust(net, history, 0.05)
        assert last <= trust <= last + 0.13
        last = trust
    assert last == 1.0
    aged = [pd.predictor_trust(net, history, age) for age in np.arange(0.0, 2.0, 0.05)]
    assert aged[0] == 1.0 and aged[-1] == 0.0 and max(-np.diff(aged)) < 0.07


def test_history_is_evenly_sampled_and_cleared_by_a_gap():
    history, row = np.zeros(pd.HISTORY_DIM), np.ones(8)
    for k in range(101):
        pd.predictor_push(history, 0.01 * k, row, 0.0)
    assert history[past_row.COUNT] == 21
    pd.predictor_push(history, 1.7, row, 0.0)
    assert history[past_row.COUNT] == 1
    for k in range(2000):
        pd.predictor_push(history, 1.7 + 0.01 * k, row, 0.0)
    assert history[past_row.COUNT] == pd.LENGTH
    pd.predictor_push(history, 0.0, row, 0.0)  # time of a new attempt
    assert history[past_row.COUNT] == 1


def test_interpolation_is_exact_at_the_knots():
    spread = pd.interpolation()
    values = np.random.default_rng(0).standard_normal(net_row.KNOTS)
    at = np.interp(np.arange(HORIZON) * STEP, pd.KNOTS, values)
    np.testing.assert_allclose(values @ spread, at, atol=1e-12)


def test_missing_and_corrupt_predictor_files_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="train one"):
        pd.load_predictor(tmp_path / "none.npz")
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"PK nothing")
    with pytest.raises(ValueError, match="no motion predictor"):
        pd.load_predictor(broken)
    net = random_net()
    pd.save_predictor(tmp_path / "good.npz", net, "a test")
    np.testing.assert_array_equal(pd.load_predictor(tmp_path / "good.npz"), net)
    np.savez(tmp_path / "old.npz", version=pd.VERSION + 1, knots=np.array(pd.KNOTS), net=net)
    with pytest.raises(ValueError, match="train it again"):
        pd.load_predictor(tmp_path / "old.npz")
    net[3] = np.nan
    np.savez(tmp_path / "nan.npz", version=pd.VERSION, knots=np.array(pd.KNOTS), net=net)
    with pytest.raises(ValueError, match="finite"):
        pd.load_predictor(tmp_path / "nan.npz")
    with pytest.raises(ValueError, match="trust"):
        random_net(gate=(0.5, 0.3, 0.1, 0.2, 0.0))
    with pytest.raises(ValueError, match="layers"):
        pd.pack_network([(np.zeros((3, 2)), np.zeros(2))] * 3, (0.3, 0.7, 0.8, 1.6, 0.0))


def test_committed_weights_are_small():
    assert pd.CHECKPOINT.stat().st_size < 500_000
    assert pd.load_predictor().shape == (net_row.DIM,)
