"""Contract: what is refused before take-off, each time in one clear line. Needs no torch."""

import math

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from policies.flying.contract import (
    METADATA_KEY,
    CameraContract,
    Contract,
    ContractError,
    ObservationContract,
    Provenance,
    check_contract,
    open_policy,
    parse_contract,
    read_contract,
)
from policies.flying.shipped import policy_file
from policies.task.observation import OBS_DIM
from vehicle.quadrotor.airframe import load_airframe

CONTRACT = Contract(
    name="test", stage="vision", airframe="paper_quad", provenance=Provenance(recipe="r", seed=1, samples=2)
)


def write(path, text=None, size=OBS_DIM):
    weight = numpy_helper.from_array(np.full((size, 4), 0.01, dtype=np.float32), "w")
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["observation", "w"], ["action"])],
        "g",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, [1, size])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, [1, 4])],
        [weight],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    if text is not None:
        helper.set_model_props(model, {METADATA_KEY: text})
    onnx.save(model, path)
    return path


def one_line(error):
    assert "\n" not in str(error.value)
    return str(error.value)


def test_round_trip(tmp_path):
    path = write(tmp_path / "p.onnx", CONTRACT.model_dump_json())
    assert read_contract(path) == CONTRACT
    session, contract = open_policy(path)
    assert contract == CONTRACT
    action = session.run(None, {"observation": np.ones((1, OBS_DIM), dtype=np.float32)})[0]
    assert action == pytest.approx(0.01 * OBS_DIM, rel=1e-5)


def test_missing_and_corrupt_files(tmp_path):
    with pytest.raises(ContractError, match="does not exist") as error:
        read_contract(tmp_path / "none.onnx")
    one_line(error)
    path = write(tmp_path / "p.onnx", CONTRACT.model_dump_json())
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ContractError, match="not a readable ONNX model") as error:
        read_contract(path)
    one_line(error)
    path.write_bytes(b"")
    with pytest.raises(ContractError):
        read_contract(path)


def test_no_contract_in_the_file(tmp_path):
    with pytest.raises(ContractError, match=METADATA_KEY):
        read_contract(write(tmp_path / "p.onnx"))


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ('"format":1', '"format":2'),
        ('"stage":"vision"', '"stage":"sound"'),
        ('"airframe":"paper_quad"', '"airframe":3'),
        ('"seed":1', '"seed":1,"extra":2'),
    ],
)
def test_wrong_field_is_named(change, match):
    text = CONTRACT.model_dump_json().replace(change, match)
    assert text != CONTRACT.model_dump_json()
    with pytest.raises(ContractError, match="contract field") as error:
        parse_contract(text, "policy x")
    one_line(error)


def test_not_json():
    with pytest.raises(ContractError, match="contract"):
        parse_contract("{nonsense")


def test_mismatches_name_both_sides():
    check_contract(CONTRACT, airframe="paper_quad", camera=CameraContract(), stage="vision")
    for arguments, words in (
        ({"airframe": "crazyflie"}, "airframe paper_quad, this flight has crazyflie"),
        ({"stage": "state"}, "stage vision, this flight has state"),
        ({"camera": CameraContract(tilt=0.5)}, "camera"),
    ):
        with pytest.raises(ContractError, match=words):
            check_contract(CONTRACT, **arguments)
    old = CONTRACT.model_copy(update={"observation": ObservationContract(version=0)})
    with pytest.raises(ContractError, match="observation version 0, this flight has 3; train it"):
        check_contract(old)


def test_the_shipped_network_fits_the_rig_that_flies_it():
    """Its tilt was written with 12 digits: rounding is no other camera."""
    airframe = load_airframe("paper_quad")
    mount = airframe.camera
    camera = CameraContract(offset=mount.offset, tilt=math.radians(mount.tilt_deg))
    found = open_policy(policy_file("vision"))[1]
    check_contract(found, airframe="paper_quad", camera=camera, stage="vision")
    with pytest.raises(ContractError, match="camera"):
        check_contract(found, camera=camera.model_copy(update={"tilt": camera.tilt + 1e-6}))


def test_size_must_match_the_promise(tmp_path):
    with pytest.raises(ContractError, match="reads 7 numbers"):
        open_policy(write(tmp_path / "p.onnx", CONTRACT.model_dump_json(), size=7))
