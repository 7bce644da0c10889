"""`perch-hil train` and `evaluate` as a user meets them."""

import json

import pytest
from typer.testing import CliRunner

from hil.cli import app

runner = CliRunner()
STATE = "policies/checkpoints/state.onnx"


def one_line(result, code=2):
    assert result.exit_code == code, result.output
    lines = result.output.strip().splitlines()
    assert len(lines) == 1, result.output
    return lines[0]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["plannr"], "did you mean 'planner'"),
        (["nowhere.onnx"], "does not exist"),
        ([STATE, "--heatmap", "map.xls"], "ends in .svg"),
    ],
)
def test_what_cannot_be_evaluated_is_one_line(arguments, says):
    assert says in one_line(runner.invoke(app, ["evaluate", *arguments]))


def test_a_damaged_policy_is_one_line(tmp_path):
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no model")
    assert "not a readable ONNX model" in one_line(runner.invoke(app, ["evaluate", str(broken)]))


def test_evaluate_as_table_says_under_what_conditions():
    result = runner.invoke(app, ["evaluate", "planner-analytic", "--episodes", "10", "--time-limit", "1"])
    assert result.exit_code == 0, result.output
    head = result.output.splitlines()[0]
    assert "vision stage" in head and "the paper's noise" in head and "1 s, seed 0" in head
    assert "91.42" in result.output  # the paper's T1 on a camera's belief


def test_evaluate_as_json_and_map(tmp_path):
    picture = tmp_path / "maps" / "map.svg"
    asked = ["evaluate", STATE, "--episodes", "10", "--time-limit", "1", "--motions", "--heatmap", str(picture)]
    result = runner.invoke(app, [*asked, "--json"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert (found["stage"], found["noise"], found["seed"]) == ("state", None, 0)
    t1 = found["points"][0]
    assert t1["name"] == "T1" and t1["episodes"] == 10 and t1["paper"]["success_percent"] == 99.92
    assert t1["interval_95"][0] <= t1["success"] <= t1["interval_95"][1]
    assert len(found["motions"]) == 24 and found["motions"][0]["paper"] is None
    assert picture.read_text().startswith("<svg")
    assert len(picture.with_suffix(".csv").read_text().splitlines()) == 73
