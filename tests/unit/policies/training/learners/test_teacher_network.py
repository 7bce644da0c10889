"""A network that teaches: torch computes what the runtime computes, on one device, and what does not fit is refused."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto, helper

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.flying.onnx_file import open_policy
from policies.task import tail_row
from policies.task.observation import OBS_DIM, TAIL, action_from_command, command_from_action
from policies.training.learners.storage import TrainingError
from policies.training.learners.teacher_network import Graph, NetworkTeacher
from tests.paths import ROOT
from vehicle.quadrotor.airframe import load_airframe

torch.set_num_threads(1)
CHECKPOINTS = ROOT / "policies" / "checkpoints"
CPU = torch.device("cpu")
FILES = sorted(path.stem for path in CHECKPOINTS.glob("*.onnx"))


@pytest.mark.parametrize("name", FILES)
def test_torch_graph_agrees_with_onnx_runtime(name):
    network = open_policy(CHECKPOINTS / f"{name}.onnx")
    observation = np.random.default_rng(0).normal(0.0, 1.5, (512, OBS_DIM)).astype(np.float32)
    wanted = network.run(observation)
    got = Graph(CHECKPOINTS / f"{name}.onnx", CPU)(torch.from_numpy(observation)).numpy()
    assert np.abs(got - wanted).max() < 1e-4


@pytest.mark.parametrize("name", FILES)
def test_teacher_graph_runs_entirely_on_its_device(name):
    """The meta device, as a GPU, refuses operands that lie elsewhere."""
    meta = torch.device("meta")
    assert Graph(CHECKPOINTS / f"{name}.onnx", meta)(torch.zeros(8, OBS_DIM, device=meta)).shape == (8, 4)


@pytest.mark.parametrize("airframe", ["paper_quad", "crazyflie"])
def test_teacher_label_gives_the_command_of_its_file_for_every_airframe(airframe):
    """Where neither vehicle's limits bind: the label in the vehicle's limits is the command that the file asks for."""
    env = Env(EnvConfig(count=16, stride=8, airframe=airframe))
    observation = torch.from_numpy(env.reset().copy())
    label = NetworkTeacher(env, "vision", CPU).act(observation)[0].numpy().astype(float)
    theirs = load_airframe("paper_quad").limits_row()
    command, previous, action = np.zeros(4), np.zeros(4), np.zeros(4)
    seen = observation.numpy().copy()
    before = slice(TAIL + tail_row.ACTION, TAIL + tail_row.ACTION + 4)
    graph = Graph(CHECKPOINTS / "vision.onnx", CPU)
    for i in range(16):
        command_from_action(seen[i, before].astype(float), env.shared.limits, previous)
        action_from_command(previous, theirs, action)
        seen[i, before] = action
    asked = graph(torch.from_numpy(seen)).numpy().astype(float)
    for i in range(16):
        command_from_action(asked[i], theirs, command)
        action_from_command(command, env.shared.limits, action)
        assert label[i] == pytest.approx(action, abs=2e-3)


def test_a_teacher_of_another_history_is_refused():
    with pytest.raises(TrainingError, match="stride 8, the recipe keeps 3"):
        NetworkTeacher(Env(EnvConfig(count=8, stride=3)), "vision", CPU)


def test_missing_teacher_is_refused():
    with pytest.raises(TrainingError, match="does not exist"):
        NetworkTeacher(Env(EnvConfig(count=8)), "absent", CPU)


def test_unknown_onnx_operator_is_refused(tmp_path: Path):
    ends = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1]) for name in ("x", "y")]
    graph = helper.make_graph([helper.make_node("Erf", ["x"], ["y"])], "g", ends[:1], ends[1:])
    onnx.save(helper.make_model(graph), tmp_path / "g.onnx")
    with pytest.raises(TrainingError, match="operator Erf"):
        Graph(tmp_path / "g.onnx", CPU)
