"""Contract: what is refused before take-off, each time in one clear line."""

import math

import pytest

from policies.flying.contract import (
    CameraContract,
    ContractError,
    ObservationContract,
    check_contract,
    parse_contract,
)
from policies.flying.onnx_file import open_policy
from policies.flying.shipped import SHIPPED, policy_file
from tests.unit.policies.flying.made_networks import CONTRACT, PAPER, made_for
from vehicle.quadrotor.airframe import load_airframe

CRAZYFLIE = load_airframe("crazyflie")


def one_line(error):
    assert "\n" not in str(error.value)
    return str(error.value)


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
    with pytest.raises(ContractError) as error:
        check_contract(CONTRACT, airframe=CRAZYFLIE)
    parent = "--parent policies/checkpoints/plain/vision.onnx"
    assert f"policy train --recipe airframe --stage vision --airframe crazyflie {parent}" in one_line(error)
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
        ("camera", {"tilt_deg": 30.0}, "upper edge is at 11.5 deg, this rig's is at -3.5 deg"),
        ("camera", {"offset": (0.02, 0.0, 0.0)}, "camera at (0.08, 0.0, 0.0) m"),
    ],
)
def test_changed_airframe_is_refused_with_the_value_that_differs(section, change, message):
    part = getattr(PAPER, section).model_copy(update=change)
    with pytest.raises(ContractError, match="train one for") as error:
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
    check_contract(open_policy(policy_file(name)).contract, airframe=made_for(name))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_network_is_flown_with_guidance(name):
    assert open_policy(policy_file(name)).contract.guidance


PAPER_CAMERA = CameraContract.of(PAPER)
SMALL = {"width": 320, "height": 240, "fx": 300.0, "fy": 300.0, "cx": 159.5, "cy": 119.5}


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (SMALL, "left edge is at"),
        ({"tilt": PAPER_CAMERA.tilt + math.radians(6.0)}, "upper edge is at"),
        ({"height": 840, "cy": 359.5}, "lower edge is at"),
        ({"width": 640, "height": 360, "fx": 362.0, "fy": 361.8, "cx": 319.5, "cy": 179.5}, "a focal length of 724 px"),
        ({"offset": (0.08, 0.0, -0.05)}, "a camera at"),
        ({"fx": math.nan}, "left edge is at"),
    ],
)
def test_camera_of_a_rig_that_sees_otherwise_is_refused(change, text):
    """The rig's as its calibration and its airframe's file have it; and a file that says it was made for that."""
    rig = PAPER_CAMERA.model_copy(update=change)
    with pytest.raises(ContractError, match="policy 'test' was made for") as error:
        check_contract(CONTRACT, airframe=PAPER, camera=rig)
    assert text in one_line(error)
    with pytest.raises(ContractError):
        check_contract(CONTRACT.model_copy(update={"camera": rig}), airframe=PAPER)


@pytest.mark.parametrize(
    "change",
    [
        {"fx": 741.2, "fy": 740.8, "cx": 655.1, "cy": 348.7},
        {"tilt": PAPER_CAMERA.tilt + math.radians(3.0)},
        {"offset": (0.09, 0.01, 0.01)},
    ],
)
def test_camera_as_a_calibration_measures_the_one_trained_with_is_flown(change):
    check_contract(CONTRACT, airframe=PAPER, camera=PAPER_CAMERA.model_copy(update=change))


def test_policy_made_for_that_camera_is_flown_with_it():
    small = PAPER_CAMERA.model_copy(update=SMALL)
    check_contract(CONTRACT.model_copy(update={"camera": small}), airframe=PAPER, camera=small)


def test_policy_for_the_true_state_is_refused_where_a_camera_sees():
    state = CONTRACT.model_copy(update={"stage": "state"})
    with pytest.raises(ContractError, match="stage state, this flight has vision: it knows of the board by a camera"):
        check_contract(state, stage="vision")


def test_refusal_is_one_printable_line_whatever_the_file_is_called():
    named = CONTRACT.model_copy(update={"name": "a\nperch-hil: GO\033[2J", "airframe": "crazyflie"})
    with pytest.raises(ContractError) as error:
        check_contract(named, airframe=PAPER)
    assert one_line(error).isprintable()
