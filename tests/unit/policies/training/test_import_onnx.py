"""An exported policy is trained on from: the actor that comes back computes what the file does."""

import onnx
import pytest
import torch
from onnx import numpy_helper

from policies.network.actor_critic import Actor, FlightActor, NetworkConfig
from policies.network.export import compare, export
from policies.training.actor import load_actor
from policies.training.import_onnx import import_actor
from policies.training.learners.storage import TrainingError
from tests.paths import ROOT
from tests.unit.policies.network.test_export import CONTRACT, actor

torch.set_num_threads(1)
CHECKPOINTS = ROOT / "policies" / "checkpoints"


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"mirrored": True, "aligned": True, "lean": 0.1},
        {"aligned": True, "lean": 0.1, "lean_unsure": 0.07, "soft": 0.5, "regimes": True},
        {"temporal": False},
        {"regimes": True},
        {"width": 192, "channels": (8, 12, 16)},
    ],
)
def test_what_was_exported_comes_back(tmp_path, options):
    path, net = tmp_path / "p.onnx", actor(**options)
    export(net, CONTRACT, path)
    again, origin = load_actor(path)
    assert again.config == NetworkConfig(**options)
    for name, weight in again.head.state_dict().items():
        assert torch.equal(weight, net.head.state_dict()[name])
    assert compare(FlightActor(again), path) < 1e-5
    assert origin["name"] == "test" and origin["recipe"] == "none"


@pytest.mark.parametrize("name", ["state", "vision"])
def test_the_networks_that_come_with_the_project_can_be_trained_on(name):
    again, origin = import_actor(CHECKPOINTS / f"{name}.onnx")
    assert isinstance(again, Actor) and origin["samples"] > 1e7


def test_what_is_not_in_the_file_begins_alike_each_time_and_draws_from_no_other_chance():
    path = CHECKPOINTS / "state.onnx"
    torch.manual_seed(1)
    first, _ = import_actor(path)
    after = torch.rand(1)
    second, _ = import_actor(path)
    for name, weight in first.state_dict().items():
        assert torch.equal(weight, second.state_dict()[name]), name
    torch.manual_seed(1)
    assert torch.equal(after, torch.rand(1))


def test_a_file_whose_weights_do_not_tell_what_it_computes_is_refused(tmp_path):
    path = tmp_path / "p.onnx"
    export(actor(), CONTRACT, path)
    model = onnx.load(path)
    for each in model.graph.initializer:
        if each.name == "actor.head.weight":
            each.name = "renamed"
    for node in model.graph.node:
        node.input[:] = ["renamed" if name == "actor.head.weight" else name for name in node.input]
    onnx.save(model, path)
    with pytest.raises(TrainingError, match="another network than its weights tell"):
        import_actor(path)


def test_a_file_of_other_layers_is_refused(tmp_path):
    path = tmp_path / "p.onnx"
    export(actor(), CONTRACT, path)
    model = onnx.load(path)
    for each in model.graph.initializer:
        if each.name == "actor.trunk.second.weight":
            each.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(each)[:, :7], each.name))
    onnx.save(model, path)
    with pytest.raises(TrainingError):
        import_actor(path)


def test_a_file_that_is_no_policy_is_refused(tmp_path):
    (tmp_path / "p.onnx").write_bytes(b"no model")
    with pytest.raises(TrainingError, match="not a readable ONNX"):
        import_actor(tmp_path / "p.onnx")
