"""What was asked for is read and checked before anything is written."""

import pytest

from hil.assembly.plan import Plan
from hil.assembly.rig import RIG_DIR, list_rigs
from hil.recording.runs import RunError
from policies.flying.contract import ContractError
from scenarios.spec import list_scenarios, load
from tests.paths import ROOT

CALIBRATION = "[camera.calibration]\nwidth = 320\nheight = 240\nfx = 300.0\nfy = 300.0\ncx = 159.5\ncy = 119.5\n"


@pytest.mark.parametrize("rig", sorted(list_rigs()))
def test_every_shipped_rig_flies_its_default_policy(rig):
    plan = Plan("simple-i", rig, None, None)
    assert plan.policy_name == plan.rig.policy.kind
    assert plan.make_policy()


@pytest.mark.parametrize("scenario", list_scenarios())
def test_every_shipped_scenario_is_flown_by_the_rig_that_it_names_unless_another_is_asked_for(scenario):
    plan = Plan(scenario, None, None, None)
    assert plan.make_policy() and plan.rig_name == load(scenario).rig
    assert Plan(scenario, "px4-sitl", "planner", None).rig_name == "px4-sitl"


@pytest.mark.parametrize("policy", ["vision", str(ROOT / "policies/checkpoints/plain/vision.onnx")])
def test_network_for_a_camera_is_refused_where_the_policy_knows_motion_capture(tmp_path, policy):
    path = tmp_path / "mine.toml"
    path.write_text('title = "state-based"\n[policy]\nkind = "planner"\nknows = "mocap"\n')
    with pytest.raises(ContractError, match="stage vision, this flight has state: it knows of the board by motion"):
        Plan("simple-i", str(path), policy, None)
    assert Plan("simple-i", str(path), None, None).make_policy()


@pytest.mark.parametrize("policy", ["state", str(ROOT / "policies/checkpoints/plain/state.onnx")])
@pytest.mark.parametrize("rig", ["sim", "field"])
def test_network_for_the_true_state_is_refused_on_a_rig_with_a_camera(rig, policy):
    with pytest.raises(ContractError, match="stage state, this flight has vision"):
        Plan("simple-i", rig, policy, None)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({'device = "/dev/video0"\n': f'device = "/dev/video0"\n{CALIBRATION}'}, "this rig's is at 28.1 deg"),
        ({'airframe = "paper_quad"': 'airframe = "{folder}/steep.toml"'}, "upper edge is at"),
    ],
)
def test_camera_as_the_rig_has_it_is_compared_with_the_one_trained_with(tmp_path, changes, text):
    frame = (ROOT / "vehicle/quadrotor/airframes/paper_quad.toml").read_text()
    assert "tilt_deg = 15" in frame
    name = 'name = "paper_quad"\n'
    (tmp_path / "steep.toml").write_text(name + frame.replace("tilt_deg = 15", "tilt_deg = 25"))
    rig = (RIG_DIR / "field.toml").read_text()
    for before, after in changes.items():
        assert before in rig
        rig = rig.replace(before, after.replace("{folder}", str(tmp_path)))
    (tmp_path / "mine.toml").write_text(rig)
    with pytest.raises(ContractError, match="was made for a picture whose") as error:
        Plan("simple-i", str(tmp_path / "mine.toml"), "vision", None)
    assert text in str(error.value) and "\n" not in str(error.value)
    assert Plan("simple-i", str(tmp_path / "mine.toml"), "planner", None).make_policy()


def test_policy_file_that_changes_after_it_was_read_is_refused(tmp_path):
    path = tmp_path / "p.onnx"
    path.write_bytes((ROOT / "policies/checkpoints/vision.onnx").read_bytes())
    plan = Plan("simple-i", "sim", str(path), None)
    plan.check_unchanged()
    path.write_bytes((ROOT / "policies/checkpoints/plain/vision.onnx").read_bytes())
    with pytest.raises(RunError, match="was changed since it was read"):
        plan.check_unchanged()
    Plan("simple-i", "sim", "planner", None).check_unchanged()
