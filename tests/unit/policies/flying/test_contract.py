"""Contract: what is refused before take-off, each time in one clear line. Needs no torch."""

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from policies.flying.contract import (
    METADATA_KEY,
    Contract,
    ContractError,
    ObservationContract,
    Provenance,
    check_contract,
    open_policy,
    parse_contract,
    read_contract,
)
from policies.flying.shipped import SHIPPED, policy_file
from policies.task.observation import OBS_DIM
from vehicle.quadrotor.airframe import load_airframe

PAPER, CRAZYFLIE = load_airframe("paper_quad"), load_airframe("crazyflie")
CONTRACT = Contract.of(PAPER, name="test", stage="vision", provenance=Provenance(recipe="r", seed=1, samples=2))


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


def test_contract_round_trips_through_json(tmp_path):
    path = write(tmp_path / "p.onnx", CONTRACT.model_dump_json())
    assert read_contract(path) == CONTRACT
    session, contract = open_policy(path)
    assert contract == CONTRACT
    action = session.run(None, {"observation": np.ones((1, OBS_DIM), dtype=np.float32)})[0]
    assert action == pytest.approx(0.01 * OBS_DIM, rel=1e-5)


def test_missing_and_corrupt_policy_files_are_refused(tmp_path):
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


def test_policy_file_without_a_contract_is_refused(tmp_path):
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
def test_contract_error_names_the_wrong_field(change, match):
    text = CONTRACT.model_dump_json().replace(change, match)
    assert text != CONTRACT.model_dump_json()
    with pytest.raises(ContractError, match="contract field") as error:
        parse_contract(text, "policy x")
    one_line(error)


def test_contract_that_is_not_json_is_refused():
    with pytest.raises(ContractError, match="contract"):
        parse_contract("{nonsense")


def test_contract_mismatch_error_names_both_values():
    check_contract(CONTRACT, airframe=PAPER, stage="vision")
    with pytest.raises(ContractError, match="stage vision, this flight has state"):
        check_contract(CONTRACT, stage="state")
    old = CONTRACT.model_copy(update={"observation": ObservationContract(version=0)})
    with pytest.raises(ContractError, match="observation version 0, this flight has 3; train it"):
        check_contract(old)


def test_airframe_without_a_policy_error_names_the_training_command():
    with pytest.raises(ContractError, match="perch-hil policy train --airframe crazyflie") as error:
        check_contract(CONTRACT, airframe=CRAZYFLIE)
    assert "made for airframe paper_quad, this flight has crazyflie" in one_line(error)


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        ("contact", {"magnet_below": 0.07}, "disc_below=0.04"),
        ("contact", {"footprint_radius": 0.1}, "disc_radius=0.13"),
        ("motors", {"lag": 0.05}, "thrust_lag=0.035"),
        ("command", {"rate_lag": 0.06}, "rate_lag=0.04"),
        ("command", {"thrust": (4.8, 15.0)}, "thrust_max=14.8"),
        ("command", {"body_rate": 4.0}, "rate_max=3.5"),
        ("camera", {"tilt_deg": 30.0}, "camera"),
    ],
)
def test_changed_airframe_is_refused_with_the_value_that_differs(section, change, message):
    part = getattr(PAPER, section).model_copy(update=change)
    with pytest.raises(ContractError, match="train one for it") as error:
        check_contract(CONTRACT, airframe=PAPER.model_copy(update={section: part}))
    assert message in one_line(error)


def test_contract_without_guidance_disables_it():
    older = CONTRACT.model_dump_json(exclude={"guidance", "vehicle"})
    contract = parse_contract(older)
    assert not contract.guidance
    check_contract(contract, airframe=PAPER)
    assert parse_contract(CONTRACT.model_copy(update={"guidance": True}).model_dump_json()).guidance


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_network_matches_its_airframe(name):
    """Its camera's tilt was written with 12 digits: rounding is no other camera."""
    check_contract(open_policy(policy_file(name))[1], airframe=PAPER)


def test_network_size_that_differs_from_its_contract_is_refused(tmp_path):
    with pytest.raises(ContractError, match="reads 7 numbers"):
        open_policy(write(tmp_path / "p.onnx", CONTRACT.model_dump_json(), size=7))
