"""A policy's file: all of it in one file, one observation in, one action out; anything else is one line."""

import hashlib

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from policies.flying.contract import METADATA_KEY, ContractError
from policies.flying.external_data import external_files
from policies.flying.onnx_file import open_policy
from policies.flying.shipped import SHIPPED, policy_file
from policies.task.observation import OBS_DIM
from tests.paths import ROOT
from tests.unit.policies.flying.made_networks import CONTRACT, FLOAT, MATMUL, tensor, write


def refused(path, match):
    with pytest.raises(ContractError, match=match) as error:
        open_policy(path)
    assert "\n" not in str(error.value) and str(path) in str(error.value)


def test_policy_file_opens_with_its_contract_and_the_digest_of_its_bytes(tmp_path):
    path = write(tmp_path / "p.onnx", weight=0.01)
    network = open_policy(path)
    assert network.contract == CONTRACT
    assert network.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert network.run(np.ones((2, OBS_DIM), dtype=np.float32)) == pytest.approx(0.01 * OBS_DIM, rel=1e-5)


def test_missing_and_corrupt_policy_files_are_refused(tmp_path):
    refused(tmp_path / "none.onnx", "does not exist")
    refused(tmp_path, "cannot be read: Is a directory")
    path = write(tmp_path / "p.onnx")
    whole = path.read_bytes()
    for data in (whole[:200], b"", b"\x08\x07 not a network", whole[:-1]):
        path.write_bytes(data)
        refused(path, "not a readable ONNX model|carries no")


def test_policy_file_without_a_contract_is_refused(tmp_path):
    refused(write(tmp_path / "p.onnx", None), METADATA_KEY)


TWICE = helper.make_node("Identity", ["action"], ["again"])
STATEFUL = helper.make_node("MatMul", ["hidden", "w"], ["more"])
READS, GIVES = tensor("observation", "batch", OBS_DIM), tensor("action", "batch", 4)


@pytest.mark.parametrize(
    ("made", "match"),
    [
        ({"nodes": (MATMUL, TWICE), "gives": (GIVES, tensor("again", "batch", 4))}, r"gives 2 tensors .action, again"),
        (
            {"nodes": (MATMUL, STATEFUL), "reads": (READS, tensor("hidden", "batch", OBS_DIM)),
             "gives": (GIVES, tensor("more", "batch", 4))},
            r"reads 2 tensors .observation, hidden.*a network that keeps a state",
        ),
        ({"weight": np.ones((OBS_DIM, 1)), "gives": (tensor("action", "batch", 1),)}, "gives batch x 1 numbers, not"),
        ({"weight": np.ones((OBS_DIM, 5)), "gives": (tensor("action", "batch", 5),)}, "gives batch x 5 numbers, not"),
        (
            {"reads": (tensor("observation", 8, OBS_DIM),), "gives": (tensor("action", 8, 4),)},
            "takes batches of 8 only; export it with a free first dimension",
        ),
        (
            {"weight": np.ones((OBS_DIM, 1)), "gives": (tensor("action", "batch", "n"),)},
            "gives batch x 1 numbers, not",
        ),
        ({"reads": (tensor("observation", 1, OBS_DIM),), "gives": (tensor("action", 1, 4),)}, "batches of 1 only"),
        (
            {"reads": (tensor("observation", "batch", 7),), "weight": np.ones((7, 4))},
            "reads batch x 7 numbers but its contract promises batch x 320",
        ),
        (
            {"nodes": (helper.make_node("Cast", ["wide"], ["observation"], to=FLOAT), MATMUL),
             "reads": (tensor("wide", "batch", OBS_DIM, kind=TensorProto.DOUBLE),)},
            r"reads a tensor.double., not a tensor.float.",
        ),
    ],
)  # fmt: skip
def test_network_of_other_inputs_or_outputs_is_refused(tmp_path, made, match):
    refused(write(tmp_path / "p.onnx", **made), match)


def test_weights_in_another_file_are_refused(tmp_path):
    outside = {"save_as_external_data": True, "location": "p.onnx.data", "size_threshold": 0}
    path = write(tmp_path / "p.onnx", **outside)
    assert (tmp_path / "p.onnx.data").exists()
    refused(path, r"keeps weights in another file .p.onnx.data., which its checksum does not cover; save it as one")


def outside_tensor():
    found = numpy_helper.from_array(np.ones((OBS_DIM, 4), dtype=np.float32), "v")
    onnx.external_data_helper.set_external_data(found, "other.bin")
    found.ClearField("raw_data")
    return found


def test_tensor_in_another_file_is_found_wherever_it_stands():
    constant = helper.make_node("Constant", [], ["c"], value=outside_tensor())
    branch = helper.make_graph([constant], "b", [], [tensor("c", OBS_DIM, 4)])
    choice = helper.make_node("If", ["yes"], ["d"], then_branch=branch, else_branch=branch)
    sparse = helper.make_sparse_tensor(outside_tensor(), numpy_helper.from_array(np.zeros(OBS_DIM * 4), "i"), [9])
    function = helper.make_function("own", "f", [], ["c"], [constant], [helper.make_opsetid("", 17)])
    plain = helper.make_graph([], "g", [], [])
    graphs = [
        helper.make_graph([], "g", [], [], [outside_tensor()]),
        helper.make_graph([constant], "g", [], []),
        helper.make_graph([choice], "g", [], []),
        helper.make_graph([], "g", [], [], sparse_initializer=[sparse]),
    ]
    models = [*map(helper.make_model, graphs), helper.make_model(plain, functions=[function])]
    for model in models:
        assert external_files(model.SerializeToString()) == ["other.bin"]
    assert external_files(helper.make_model(plain).SerializeToString()) == []


@pytest.mark.parametrize("file", [*map(policy_file, SHIPPED), *(ROOT / "policies/checkpoints/plain").glob("*.onnx")])
def test_network_of_the_project_keeps_its_weights_inside(file):
    assert external_files(file.read_bytes()) == []
    open_policy(file)


@pytest.mark.parametrize("data", [b"\x3a\x05\x00", b"\x3b", b"\x3a" + b"\xff" * 12, b"\x3a\x02\x0a" * 3])
def test_bytes_that_are_no_message_raise_value_error(data):
    with pytest.raises(ValueError, match="byte"):
        external_files(data)


def test_model_nested_without_end_raises_value_error():
    data = b""
    for _ in range(200):  # a graph in an attribute of a node of a graph
        graph = b"\x0a" + size(data) + data
        data = b"\x32" + size(graph) + graph
        data = b"\x2a" + size(data) + data
    with pytest.raises(ValueError, match="deep"):
        external_files(b"\x3a" + size(b"\x0a" + size(data) + data) + b"\x0a" + size(data) + data)


def size(data):
    """The length of `data` as protobuf writes it."""
    found, left = bytearray(), len(data)
    while left > 127:
        found.append(left & 127 | 128)
        left >>= 7
    return bytes([*found, left])
