import numpy as np
import pytest

from policies.prediction import context_row, net_row, scratch_row
from policies.prediction import learned as pd
from policies.prediction.future import HORIZON, STEP, predict_future
from policies.prediction.learned_data import TARGETS, make_examples

torch = pytest.importorskip("torch")
training = pytest.importorskip("policies.prediction.learned_training")


@pytest.fixture(scope="module")
def examples():
    return make_examples(60, seed=77)


def test_examples_are_reproducible_and_finite(examples):
    again = make_examples(60, seed=77)
    np.testing.assert_array_equal(examples.inputs, again.inputs)
    np.testing.assert_array_equal(examples.targets, again.targets)
    assert not np.array_equal(examples.inputs[:50], make_examples(60, seed=78).inputs[:50])
    assert (
        examples.inputs.shape == (len(examples.contexts), net_row.INPUTS)
        and examples.contexts.shape[1] == context_row.DIM
    )
    assert examples.targets.shape[1:] == (TARGETS, 4)
    assert np.isfinite(examples.inputs).all() and np.isfinite(examples.targets).all()
    assert len(examples.inputs) > 600
    with pytest.raises(ValueError, match="at least one drive"):
        make_examples(0, 1)


def test_targets_start_where_the_board_is_believed(examples):
    first = examples.targets[:, 0]
    assert np.median(np.hypot(first[:, 0], first[:, 1])) < 0.05
    assert np.median(np.abs(first[:, 3] - examples.contexts[:, 0])) < 0.15


def test_predictor_kernel_and_torch_agree(examples):
    row = pd.load_predictor()
    network, path = training.build_network(), training.DrivenPath()
    training.start_from(network, row)
    np.testing.assert_array_equal(training.network_row(network)[:-5], row[:-5])
    with torch.no_grad():
        outputs = network(torch.from_numpy(examples.inputs))
        paths = path(torch.from_numpy(examples.contexts[:, :3]), outputs).numpy()
    scratch, future, history = (
        np.zeros(scratch_row.DIM, np.float32),
        np.zeros((HORIZON, 8)),
        np.zeros(pd.HISTORY_DIM),
    )
    for i in range(0, len(examples.inputs), 20):
        scratch[: net_row.INPUTS] = examples.inputs[i]
        pd.predictor_network(row, scratch)
        np.testing.assert_allclose(scratch[-net_row.OUTPUTS :], outputs[i].numpy(), atol=2e-5)
    # One whole drive through the history, against torch on the inputs it gives.
    state = np.array([0.0, 0.0, 1.5, 0.0, 1.6, 0.3, 0.4, 0.5])
    for k in range(400):
        pd.predictor_push(history, 0.01 * k, state + 0.01 * k * np.array([1.6, 0.1, 0, 0, 0, 0, 0, 0]), 0.05)
    predict_future(state, 0.5, STEP, future)
    pd.predict_learned(history, 4.0, state, 0.01, 0.1, 0.05, 40.0, STEP, row, scratch, 1.0, future)
    with torch.no_grad():
        outputs = network(torch.from_numpy(scratch[: net_row.INPUTS][None].copy())).numpy()[0]
        pd.predictor_network(row, scratch)
        np.testing.assert_allclose(scratch[-net_row.OUTPUTS :], outputs, atol=2e-5)
        pd.believe_filter(0.1, scratch)
        predicted = torch.from_numpy(scratch[-net_row.OUTPUTS :][None].copy())
        wanted = path(torch.tensor([[1.6, 0.3, 0.5]]), predicted).numpy()[0]
    np.testing.assert_allclose(future[:, [0, 1, 3, 4]], wanted, atol=1e-4)
    assert paths.shape == (len(examples.inputs), HORIZON, 4)


def test_a_known_speed_is_not_corrected_an_unknown_one_is():
    scratch = np.zeros(scratch_row.DIM, np.float32)
    predicted = scratch[-net_row.OUTPUTS :]
    predicted[: net_row.KNOTS] = 0.4
    pd.believe_filter(0.0, scratch)
    assert predicted[0] == 0.0 and 0.0 < predicted[4] < 0.4
    predicted[: net_row.KNOTS] = 0.4
    pd.believe_filter(10.0, scratch)
    np.testing.assert_allclose(predicted[: net_row.KNOTS], 0.4, atol=1e-3)


def test_committed_network_beats_the_base_motion_on_held_out_drives(examples):
    network = training.build_network()
    training.start_from(network, pd.load_predictor())
    found = training.errors(network, training.DrivenPath(), examples)
    at = [int(np.argmin(np.abs(training.AHEAD - t))) for t in (0.45, 1.05, 1.95)]
    for k in at:
        assert found["learned"][:, k].mean() < 0.85 * found["base"][:, k].mean()


def test_reflection_signs_give_the_inputs_of_the_reflected_drive():
    signs, _ = training.mirror_signs()
    rows = []
    for side in (1.0, -1.0):
        history, x, out = np.zeros(pd.HISTORY_DIM), np.zeros(8), np.zeros(net_row.INPUTS, np.float32)
        for k in range(300):
            t = 0.01 * k
            x[:] = 2.0 * t, side * 0.3 * np.sin(t), 1.5, side * 0.2, 2.0, side * 0.4, 0.0, 0.6
            pd.predictor_push(history, t, x, 0.04)
        pd.predictor_inputs(history, 2.99, x, 0.01, 0.1, 0.04, 30.0, out)
        rows.append(out)
    np.testing.assert_allclose(rows[1], rows[0] * signs.numpy(), atol=1e-6)


def test_short_predictor_training_lowers_the_error_and_writes_a_loadable_file(tmp_path, capsys):
    training.train(0.05, 60, 5, tmp_path / "p.npz")
    assert "learned" in capsys.readouterr().out
    assert pd.load_predictor(tmp_path / "p.npz").shape == (net_row.DIM,)
