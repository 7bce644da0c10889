"""ONNX policies made for tests: linear ones, and such as must be refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from policies.flying.contract import METADATA_KEY, Contract, Provenance
from policies.flying.onnx_file import open_policy
from policies.flying.shipped import policy_file
from policies.task.observation import OBS_DIM
from vehicle.quadrotor.airframe import Airframe, load_airframe

PAPER = load_airframe("paper_quad")
CONTRACT = Contract.of(PAPER, name="test", stage="vision", provenance=Provenance(recipe="r", seed=1, samples=2))
FLOAT = TensorProto.FLOAT
MATMUL = helper.make_node("MatMul", ["observation", "w"], ["action"])


def made_for(name: str) -> Airframe:
    """The airframe that a policy's network was made for; the paper's quadrotor for a planner."""
    file = policy_file(name)
    return PAPER if file is None else load_airframe(open_policy(file).contract.airframe)


def tensor(name, *shape, kind=FLOAT):
    """A declared input or output."""
    return helper.make_tensor_value_info(name, kind, shape)


def write(
    path: Path,
    text: str | None = CONTRACT.model_dump_json(),
    *,
    weight: np.ndarray | float = 0.001,
    nodes: Sequence[onnx.NodeProto] = (MATMUL,),
    reads: Sequence[onnx.ValueInfoProto] = (tensor("observation", "batch", OBS_DIM),),
    gives: Sequence[onnx.ValueInfoProto] = (tensor("action", "batch", 4),),
    more: Sequence[onnx.TensorProto] = (),
    **saved,
) -> Path:
    """Write a policy with `text` as its contract: by default the observation (batch, OBS_DIM) times `weight`, a
    (OBS_DIM, 4) array or one number. `more`: other initializers; `saved`: options of onnx.save."""
    numbers = np.full((OBS_DIM, 4), weight) if np.isscalar(weight) else np.asarray(weight)
    initializers = [numpy_helper.from_array(numbers.astype(np.float32), "w"), *more]
    graph = helper.make_graph(list(nodes), "g", list(reads), list(gives), initializers)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    if text is not None:
        helper.set_model_props(model, {METADATA_KEY: text})
    onnx.save(model, path, **saved)
    return path
