"""Export: ONNX against torch to 1e-5, size, contract inside, and nothing written when something is wrong."""

import numpy as np
import onnx
import pytest
import torch

from policies.flying.contract import Contract, ContractError, Provenance
from policies.flying.onnx_file import open_policy
from policies.network.actor_critic import Actor, FlightActor, NetworkConfig, normalisation
from policies.network.export import MAX_BYTES, TOLERANCE, compare, export, import_actor
from policies.task.observation import OBS_DIM
from tests.paths import ROOT
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


@pytest.mark.parametrize("options", [{}, {"temporal": False}, {"geometry": False}, {"symmetric": False}])
def test_exported_onnx_agrees_with_torch(tmp_path, options):
    path, net = tmp_path / "p.onnx", actor(**options)
    assert export(net, CONTRACT, path) <= TOLERANCE == 1e-5
    assert compare(FlightActor(net), path) <= TOLERANCE
    assert path.stat().st_size < MAX_BYTES
    assert open_policy(path).contract == CONTRACT
    assert not list(tmp_path.glob("*.tmp.*"))


@pytest.mark.parametrize("name", ["vision", "state"])
def test_plain_network_differs_from_torch_by_less_than_the_tolerance(name):
    path = ROOT / "policies" / "checkpoints" / "plain" / f"{name}.onnx"
    assert compare(FlightActor(import_actor(path)[0]), path) < 0.2 * TOLERANCE


def test_export_comparison_uses_the_given_observations(tmp_path):
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


def test_export_of_non_finite_weights_keeps_the_old_file(tmp_path):
    path, net = tmp_path / "p.onnx", actor()
    export(net, CONTRACT, path)
    before = path.read_bytes()
    with torch.no_grad():
        net.head.weight[0, 0] = float("nan")
    with pytest.raises(ContractError, match="not finite"):
        export(net, CONTRACT, path)
    assert path.read_bytes() == before


def test_export_of_a_too_large_network_is_refused(tmp_path):
    with pytest.raises(ContractError, match="bytes"):
        export(actor(width=800), CONTRACT, tmp_path / "p.onnx")
    assert not (tmp_path / "p.onnx").exists()


def test_exported_network_clips_its_actions(tmp_path):
    net = actor()
    with torch.no_grad():
        net.head.bias.fill_(5.0)
    export(net, CONTRACT, tmp_path / "p.onnx")
    import onnxruntime

    session = onnxruntime.InferenceSession(str(tmp_path / "p.onnx"))
    out = np.asarray(session.run(None, {"observation": np.zeros((3, OBS_DIM), dtype=np.float32)})[0])
    assert out.shape == (3, 4) and out.max() <= 1.0


def test_exported_file_has_one_last_layer_and_no_conditions(tmp_path):
    """One last layer and nothing that decides: no gated experts, no law."""
    export(actor(), CONTRACT, tmp_path / "p.onnx")
    kinds = [node.op_type for node in onnx.load(tmp_path / "p.onnx").graph.node if node.op_type != "Constant"]
    assert kinds.count("Gemm") == 6 and kinds.count("Clip") == 1 and len(kinds) < 80
    assert not {"Where", "Less", "LessOrEqual", "Greater", "GreaterOrEqual", "And", "Or", "If", "Atan"} & set(kinds)


@pytest.mark.parametrize(
    "options",
    [{}, {"symmetric": False}, {"temporal": False}, {"geometry": False, "width": 64, "channels": (8, 12, 16)}],
)
def test_exported_actor_can_be_imported_again(tmp_path, options):
    path, net = tmp_path / "p.onnx", actor(**options)
    export(net, CONTRACT, path)
    again, contract = import_actor(path)
    assert again.config == NetworkConfig(**options) and contract == CONTRACT
    assert compare(FlightActor(again), path) < 1e-5


def test_import_initialises_missing_weights_equally_and_keeps_the_random_state(tmp_path):
    export(actor(), CONTRACT, tmp_path / "p.onnx")
    torch.manual_seed(1)
    first, _ = import_actor(tmp_path / "p.onnx")
    after = torch.rand(1)
    second, _ = import_actor(tmp_path / "p.onnx")
    for name, weight in first.state_dict().items():
        assert torch.equal(weight, second.state_dict()[name]), name
    torch.manual_seed(1)
    assert torch.equal(after, torch.rand(1))


def changed(path, old, new):
    """The file with an initializer renamed, so that it computes something else than its weights."""
    model = onnx.load(path)
    for each in model.graph.initializer:
        each.name = new if each.name == old else each.name
    for node in model.graph.node:
        node.input[:] = [new if name == old else name for name in node.input]
    onnx.save(model, path)


def test_import_refuses_a_graph_that_disagrees_with_its_weights(tmp_path):
    export(actor(), CONTRACT, tmp_path / "p.onnx")
    changed(tmp_path / "p.onnx", "actor.head.weight", "renamed")
    with pytest.raises(ContractError, match="something else than its weights tell"):
        import_actor(tmp_path / "p.onnx")


def test_import_refuses_unknown_weights(tmp_path):
    export(actor(), CONTRACT, tmp_path / "p.onnx")
    changed(tmp_path / "p.onnx", "actor.head.weight", "actor.other.weight")
    with pytest.raises(ContractError, match="does not know"):
        import_actor(tmp_path / "p.onnx")


def test_import_refuses_a_file_without_a_network_description():
    with pytest.raises(ContractError, match="a teacher, not a parent"):
        import_actor(ROOT / "policies" / "checkpoints" / "vision.onnx")
