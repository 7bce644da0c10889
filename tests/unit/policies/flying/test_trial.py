"""What a network answers to recorded observations decides whether it may fly."""

import itertools

import numpy as np
import pytest
from onnx import helper, numpy_helper

from policies.flying.contract import ContractError
from policies.flying.onnx_file import open_policy
from policies.flying.registry import POLICY, PREDICTOR, policy_factory
from policies.flying.shipped import SHIPPED, policy_file
from policies.flying.trial import SLOWEST, STRIDE, distance, latency, recorded_observations, try_policy
from policies.task import tail_row
from policies.task.observation import NEWEST, OBS_DIM, TAIL
from tests.paths import ROOT
from tests.unit.policies.flying.made_networks import CONTRACT, PAPER, write

FILES = [*map(policy_file, SHIPPED), *sorted((ROOT / "policies/checkpoints/plain").glob("*.onnx"))]


def refused(path, match):
    """By the trial itself, and before a run."""
    for trial in (lambda: try_policy(open_policy(path)), lambda: policy_factory(str(path), PAPER)):
        with pytest.raises(ContractError, match=match) as error:
            trial()
        assert "\n" not in str(error.value)


def test_recorded_observations_are_those_of_flights():
    found = recorded_observations()
    assert found.shape[1] == OBS_DIM and len(found) >= 200 and found.dtype == np.float32
    assert np.isfinite(found).all()
    board = np.linalg.norm(found[:, NEWEST : NEWEST + 3], axis=1)
    assert board.max() > 2.0 and board.min() < 0.3, "from the start to the contact"
    rho = found[:, TAIL + tail_row.RHO]
    assert 0.0 <= rho.min() < 0.9 <= rho.max() <= 1.0


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}-{file.stem}")
def test_network_of_the_project_passes(file):
    assert np.abs(try_policy(open_policy(file))).max() <= 1.0


NOISE = helper.make_node("RandomNormalLike", ["quiet"], ["noise"])
QUIET = helper.make_node("MatMul", ["observation", "w"], ["quiet"])
MEAN = helper.make_node("ReduceMean", ["quiet"], ["noise"], axes=[0])
ADDED = helper.make_node("Add", ["quiet", "noise"], ["action"])
TENTH = helper.make_node("Clip", ["loud", "low", "high"], ["action"])
LOUD = helper.make_node("Add", ["quiet", "noise"], ["loud"])
LIMITS = [numpy_helper.from_array(np.array(v, dtype=np.float32), n) for n, v in (("low", -1.0), ("high", 1.0))]
THREE = [numpy_helper.from_array(np.ones(3, dtype=bool), "three")]  # rows, as the runtime finds out while it runs
ROWS, NOISE_ROWS = (helper.make_node("Compress", ["quiet", "three"], [name], axis=0) for name in ("action", "noise"))


@pytest.mark.parametrize(
    ("made", "match"),
    [
        ({"weight": float("nan")}, "not finite to 240 of 240 observations"),
        ({"weight": 3.0}, r"answers with [0-9.e+]+; actions are in .-1, 1."),
        ({"nodes": (QUIET, NOISE, LOUD, TENTH), "more": LIMITS}, "does not answer the same twice"),
        ({"nodes": (QUIET, MEAN, ADDED), "weight": "scattered"}, "answers otherwise alone than in a batch"),
        ({"nodes": (QUIET, NOISE_ROWS, ADDED), "more": THREE}, "cannot be run on recorded observations"),
        ({"nodes": (QUIET, ROWS), "more": THREE}, "answers 240 observations with 3 x 4 numbers, not 240 x 4"),
    ],
)
def test_network_whose_answers_cannot_be_flown_is_refused(tmp_path, made, match):
    if isinstance(made.get("weight"), str):
        made = {**made, "weight": np.random.default_rng(1).normal(0.0, 3e-4, (OBS_DIM, 4))}
    refused(write(tmp_path / "p.onnx", **made), match)


def test_network_that_is_too_slow_is_refused(tmp_path):
    network = open_policy(write(tmp_path / "p.onnx"))
    for step in (0.4 * SLOWEST, 1.1 * SLOWEST):
        ticks = itertools.count()
        watch = lambda ticks=ticks, step=step: step * next(ticks)  # noqa: E731
        if step < SLOWEST:
            assert latency(network, watch) == pytest.approx(step)
        else:
            with pytest.raises(ContractError, match=r"takes 2.2 ms for an answer on this computer, 2 ms are allowed"):
                latency(network, watch)


def test_distance_is_told_in_rates_and_thrust():
    limits, rest = CONTRACT.action, np.zeros((3, 4), dtype=np.float32)
    apart = distance(np.array([[0.1, -0.2, 0.0, 0.5], [0.0, 0.0, 0.0, 0.1], [0.0] * 4], dtype=np.float32), rest, limits)
    assert apart.rate == pytest.approx((0.0, 0.2 * limits.rate_max))
    half = 0.5 * (limits.thrust_max - limits.thrust_min)
    assert apart.thrust == pytest.approx((0.1 * half, 0.5 * half))


def test_shipped_network_keeps_the_recorded_stride():
    assert open_policy(policy_file("vision")).contract.observation.stride == STRIDE


def test_factory_says_what_it_has_read(tmp_path):
    path = write(tmp_path / "p.onnx")
    made = policy_factory(str(path), PAPER)
    assert made.digests == {POLICY: open_policy(path).sha256}
    assert list(policy_factory("planner", PAPER).digests) == [PREDICTOR]
    assert policy_factory("planner-analytic", PAPER).digests == {}
