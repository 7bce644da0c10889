"""`perch-hil policy check`, and the same refusals before a run: a line each, exit code 2."""

import json

import numpy as np
import pytest
from onnx import helper
from typer.testing import CliRunner

from hil.cli.main import app
from policies.task.observation import OBS_DIM
from tests.paths import ROOT
from tests.unit.policies.flying.made_networks import CONTRACT, MATMUL, tensor, write

PLAIN = ROOT / "policies/checkpoints/plain/vision.onnx"
READS, GIVES = tensor("observation", "batch", OBS_DIM), tensor("action", "batch", 4)
STATEFUL = helper.make_node("MatMul", ["hidden", "w"], ["more"])
BAD = {
    "two outputs": {
        "nodes": (MATMUL, helper.make_node("Identity", ["action"], ["again"])),
        "gives": (GIVES, tensor("again", "batch", 4)),
    },
    "one number for four": {"weight": np.full((OBS_DIM, 1), 1e-3), "gives": (tensor("action", "batch", 1),)},
    "a frozen batch": {"reads": (tensor("observation", 8, OBS_DIM),), "gives": (tensor("action", 8, 4),)},
    "a recurrent input": {
        "nodes": (MATMUL, STATEFUL),
        "reads": (READS, tensor("hidden", "batch", OBS_DIM)),
        "gives": (GIVES, tensor("more", "batch", 4)),
    },
    "weights outside": {"save_as_external_data": True, "location": "p.onnx.data", "size_threshold": 0},
    "not finite": {"weight": float("nan")},
    "out of range": {"weight": 3.0},
    "the true state": {"text": CONTRACT.model_copy(update={"stage": "state"}).model_dump_json()},
    "another airframe": {"text": CONTRACT.model_copy(update={"airframe": "crazyflie"}).model_dump_json()},
    "no contract": {"text": None},
}


def call(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_shipped_network_is_flyable_in_five_lines():
    result = call("policy", "check", "vision")
    assert result.exit_code == 0, result.output
    lines = [line.split()[:2] for line in result.stdout.splitlines()]
    assert lines == [[name, "ok"] for name in ("file", "contract", "answers", "latency", "difference")]
    assert result.stdout.splitlines()[-1].endswith("it is the shipped network")


def test_difference_to_the_shipped_network_is_told_in_units():
    result = call("policy", "check", PLAIN, "--json")
    assert result.exit_code == 0, result.output
    *_, last = json.loads(result.stdout)
    assert last["check"] == "difference" and "rad/s" in last["text"] and "m/s^2" in last["text"]


@pytest.mark.parametrize("made", BAD.values(), ids=BAD.keys())
def test_file_that_cannot_be_flown_is_refused_by_the_check_and_before_a_run(tmp_path, made):
    path = write(tmp_path / "p.onnx", **made)
    result = call("policy", "check", path)
    assert result.exit_code == 2, result.output
    refused = [line for line in result.stdout.splitlines() if " REFUSED " in line]
    assert len(refused) == 1 and "Traceback" not in result.output
    for words in (["run", "simple-i"], ["campaign", "simple-i"]):
        flown = call(*words, "--policy", path, "--out", tmp_path / "runs")
        assert flown.exit_code == 2, flown.output
        (line,) = flown.stderr.splitlines()
        assert line == f"perch-hil: {refused[0].split(' REFUSED ')[1].strip()}"
    assert not (tmp_path / "runs").exists()


def test_several_faults_are_told_a_line_each(tmp_path):
    text = CONTRACT.model_copy(update={"stage": "state"}).model_dump_json()
    result = call("policy", "check", write(tmp_path / "p.onnx", text, weight=float("nan")))
    assert result.exit_code == 2
    assert [line.split()[:2] for line in result.stdout.splitlines()] == [
        ["file", "ok"], ["contract", "REFUSED"], ["answers", "REFUSED"],
    ]  # fmt: skip


def test_check_compares_with_the_rig_that_is_named(tmp_path):
    rig = tmp_path / "small.toml"
    lens = "width = 320\nheight = 240\nfx = 300.0\nfy = 300.0\ncx = 159.5\ncy = 119.5\n"
    rig.write_text(f'title = "x"\n[camera]\nkind = "v4l2"\ndevice = "/dev/video0"\n[camera.calibration]\n{lens}')
    result = call("policy", "check", "vision", "--rig", rig)
    assert result.exit_code == 2 and "left edge is at" in result.stdout


@pytest.mark.parametrize("words", [["planner"], ["none.onnx"], ["vision", "--rig", "nowhere"]])
def test_what_has_no_file_or_no_rig_is_one_line(words):
    result = call("policy", "check", *words)
    assert result.exit_code == 2 and len(result.output.splitlines()) == 1 and "Traceback" not in result.output


def test_check_alone_stays_the_checklists():
    assert "checklist" in call("check", "--help").stdout
