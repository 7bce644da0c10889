"""Export: ONNX against torch to 1e-5, size, contract inside, and nothing written when something is wrong."""

import numpy as np
import pytest
import torch

from policies.flying.contract import Contract, ContractError, Provenance, read_contract
from policies.network.actor_critic import Actor, FlightActor, NetworkConfig, normalisation
from policies.network.export import MAX_BYTES, compare, export
from policies.task.observation import OBS_DIM
from vehicle.quadrotor.airframe import load_airframe

torch.set_num_threads(1)
SHIFT, SCALE = normalisation()
CONTRACT = Contract.of(
    load_airframe("paper_quad"),
    name="test",
    stage="state",
    provenance=Provenance(recipe="none", seed=0, samples=0),
    shift=SHIFT,
    scale=SCALE,
)


def actor(**options):
    torch.manual_seed(1)
    made = Actor(NetworkConfig(**options))
    torch.nn.init.normal_(made.head.weight, std=0.2)
    return made


@pytest.mark.parametrize("options", [{}, {"temporal": False}, {"geometry": False}, {"width": 192}, {"regimes": True}])
def test_onnx_equals_torch(tmp_path, options):
    path, net = tmp_path / "p.onnx", actor(**options)
    assert export(net, CONTRACT, path) <= 1e-5
    assert compare(FlightActor(net), path) <= 1e-5
    assert path.stat().st_size < MAX_BYTES
    assert read_contract(path) == CONTRACT
    assert not list(tmp_path.glob("*.tmp.*"))


def test_they_are_compared_on_the_observations_given(tmp_path):
    path, net = tmp_path / "p.onnx", actor()
    export(net, CONTRACT, path)
    other = actor(width=96)
    assert compare(FlightActor(other), path) > 1e-3
    observations = np.full((1, OBS_DIM), 1e6, dtype=np.float32)  # far beyond the clip at the outputs
    with torch.no_grad():
        for each in (net, other):
            each.head.weight.zero_()
    export(net, CONTRACT, path, observations)
    assert compare(FlightActor(other), path, observations) == 0.0


def test_weights_that_are_not_finite_keep_the_old_file(tmp_path):
    path, net = tmp_path / "p.onnx", actor()
    export(net, CONTRACT, path)
    before = path.read_bytes()
    with torch.no_grad():
        net.head.weight[0, 0] = float("nan")
    with pytest.raises(ContractError, match="not finite"):
        export(net, CONTRACT, path)
    assert path.read_bytes() == before


def test_too_large_is_refused(tmp_path):
    with pytest.raises(ContractError, match="bytes"):
        export(actor(width=800), CONTRACT, tmp_path / "p.onnx")
    assert not (tmp_path / "p.onnx").exists()


def test_actions_are_clipped(tmp_path):
    net = actor()
    with torch.no_grad():
        net.head.bias.fill_(5.0)
    export(net, CONTRACT, tmp_path / "p.onnx")
    import onnxruntime

    session = onnxruntime.InferenceSession(str(tmp_path / "p.onnx"))
    out = session.run(None, {"observation": np.zeros((3, OBS_DIM), dtype=np.float32)})[0]
    assert out.shape == (3, 4) and out.max() <= 1.0
