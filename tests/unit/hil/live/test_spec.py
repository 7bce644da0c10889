"""What the processes of a run must agree on, and how one that does not is told."""

import re

import pytest

from hil.assembly.plan import Plan
from hil.live.spec import disagreement, run_digests
from hil.recording import provenance
from policies.flying.registry import POLICY, PREDICTOR
from tests.paths import ROOT

CHECKPOINTS = ROOT / "policies" / "checkpoints"


def digests(policy="vision", rig="sim", scenario="simple-i", seed=0):
    return run_digests(Plan(scenario, rig, policy, "model"), seed)


def differing(one, other):
    return [name for name in {**one, **other} if one.get(name) != other.get(name)]


def test_every_part_of_a_run_has_its_digest(tmp_path):
    ours = digests()
    assert list(ours) == ["scenario", "rig", "airframe", POLICY, "seed", "code"]
    assert ours[POLICY] == provenance.file_sha256(CHECKPOINTS / "vision.onnx")
    assert differing(ours, digests(scenario="simple-ii")) == ["scenario"]
    assert differing(ours, digests(seed=1)) == ["seed"]
    planner = digests("planner")
    assert planner[PREDICTOR] == provenance.file_sha256(CHECKPOINTS / "predictor.npz")
    assert set(differing(ours, planner)) == {POLICY, "policy", PREDICTOR}


def test_airframe_of_the_same_name_and_another_mass_differs(tmp_path):
    frame = (ROOT / "vehicle/quadrotor/airframes/paper_quad.toml").read_text()
    quad, rig, found = tmp_path / "quad.toml", tmp_path / "rig.toml", []
    rig.write_text(f'title = "x"\n[vehicle]\nairframe = "{quad}"\n')
    for mass in ("mass = 0.6", "mass = 0.7"):
        quad.write_text('name = "paper_quad"\n' + re.sub(r"^mass = [0-9.]+", mass, frame, flags=re.MULTILINE))
        found.append(digests(rig=str(rig)))
    assert differing(*found) == ["airframe"]


def test_policy_of_the_same_name_and_another_content_differs(tmp_path):
    """A copy at another path is the same policy; another network in a file of the same name is not."""
    found = []
    for folder, network in (("here", "vision"), ("there", "vision"), ("other", "plain/vision")):
        path = tmp_path / folder / "p.onnx"
        path.parent.mkdir()
        path.write_bytes((CHECKPOINTS / f"{network}.onnx").read_bytes())
        found.append(digests(str(path)))
    here, there, other = found
    assert here == there
    text = disagreement("brain", other, here, remote=True)
    assert text == (
        f"brain has another policy file on its host ({other[POLICY][:12]}) than this run ({here[POLICY][:12]}): "
        "copy this run's file there and name it by --policy"
    )


@pytest.mark.parametrize("name", [POLICY, PREDICTOR, "code", "seed", "airframe"])
@pytest.mark.parametrize("remote", [True, False])
def test_disagreement_names_what_differs_in_one_line(name, remote):
    ours = {"seed": "1", "airframe": "a", POLICY: "p", PREDICTOR: "m", "code": "c"}
    assert disagreement("brain", ours, ours, remote=remote) == ""
    others = ({**ours, name: "other"}, {**ours, name: ["\033[2J"]}, {k: v for k, v in ours.items() if k != name})
    for theirs in others:
        text = disagreement("brain", theirs, ours, remote=remote)
        assert name in text and text.startswith("brain ") and text.isprintable()
