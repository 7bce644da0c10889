"""`perch-hil policy train` and `policy evaluate` as a user meets them, by their flat names."""

import json
import signal

import pytest
from typer.testing import CliRunner

from hil.cli.main import app

torch = pytest.importorskip("torch")

runner = CliRunner()
STATE = "policies/checkpoints/state.onnx"
TINY = """
title = "tiny"
[env]
count = 16
future_stride = 10
horizon = 160
odometry_noise = 0.0
[[phase]]
kind = "dagger"
settings = { samples = 512, horizon = 8, replay = 512, batch = 32, batches = 1, teacher_fade = 256 }
"""


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return str(path)


def one_line(result, code=2):
    assert result.exit_code == code, result.output
    lines = result.output.strip().splitlines()
    assert len(lines) == 1, result.output
    return lines[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plannr"], "did you mean 'planner'"),
        (["nowhere.onnx"], "does not exist"),
        ([STATE, "--heatmap", "map.xls"], "ends in .svg"),
        (["planner", "--airframe", "paper_qad"], "no airframe 'paper_qad'"),
    ],
)
def test_evaluation_error_is_one_line(arguments, message):
    assert message in one_line(runner.invoke(app, ["evaluate", *arguments]))


def test_damaged_policy_error_is_one_line(tmp_path):
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no model")
    assert "not a readable ONNX model" in one_line(runner.invoke(app, ["evaluate", str(broken)]))


@pytest.mark.parametrize("airframe", ["paper_quad", "crazyflie"])
def test_evaluation_table_names_its_conditions(airframe):
    asked = ["evaluate", "planner-analytic", "--episodes", "10", "--time-limit", "1", "--airframe", airframe]
    result = runner.invoke(app, asked)
    assert result.exit_code == 0, result.output
    head = result.output.splitlines()[0]
    assert f"planner-analytic on {airframe}" in head
    assert "vision stage" in head and "the paper's noise" in head and "1 s, seed 0" in head
    assert "91.42" in result.output  # the paper's T1 on a camera's belief


def test_evaluate_as_json_and_map(tmp_path):
    picture = tmp_path / "maps" / "map.svg"
    asked = [
        "evaluate",
        STATE,
        "--episodes",
        "10",
        "--time-limit",
        "1",
        "--motions",
        "--robust",
        "--heatmap",
        str(picture),
    ]
    result = runner.invoke(app, [*asked, "--json"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert (found["stage"], found["noise"], found["seed"]) == ("state", None, 0)
    t1 = found["points"][0]
    assert t1["name"] == "T1" and t1["episodes"] == 10 and t1["paper"]["success_percent"] == 99.92
    assert t1["interval_95"][0] <= t1["success"] <= t1["interval_95"][1]
    assert len(found["robustness"]) == 21 and found["robustness"][0]["name"] == "T1, no drag"
    assert len(found["motions"]) == 24 and found["motions"][0]["paper"] is None
    assert picture.read_text().startswith("<svg")
    assert len(picture.with_suffix(".csv").read_text().splitlines()) == 73


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--recipe", "vison"], "did you mean 'vision'"),
        (["--set", "network.widht=3"], "did you mean 'width'"),
        (["--airframe", "papr_quad"], "did you mean 'paper_quad'"),
        (["--device", "cuda:7"], "was asked for, but torch sees"),
        (["--device", "gpu"], "no device 'gpu'"),
        (["--parent", "nowhere"], "nowhere does not exist"),
        (["--resume"], "does not exist"),
    ],
)
def test_training_error_is_one_line_and_leaves_no_folder(tmp_path, tiny, arguments, message):
    result = runner.invoke(app, ["train", "--recipe", tiny, "--out", str(tmp_path / "run"), *arguments])
    assert result.exit_code == 2
    reported = [line for line in result.output.splitlines() if line.startswith("perch-hil: ")]
    assert len(reported) == 1 and message in reported[0] and "Traceback" not in result.output
    assert not list((tmp_path / "run").glob("*.pt"))


def test_finished_training_is_not_overwritten(tmp_path, tiny):
    asked = ["train", "--recipe", tiny, "--out", str(tmp_path / "run")]
    result = runner.invoke(app, asked)
    assert result.exit_code == 0, result.output
    assert "perch-hil policy evaluate" in result.stdout
    assert {"policy.onnx", "curve.csv", "curve.svg", "actor.pt"} <= {p.name for p in (tmp_path / "run").iterdir()}
    assert "--resume" in one_line(runner.invoke(app, asked))


def test_curve_as_json_is_that_of_the_folder(tmp_path, tiny):
    result = runner.invoke(app, ["train", "--recipe", tiny, "--out", str(tmp_path / "run"), "--json"])
    assert result.exit_code == 0, result.output
    curve = json.loads(result.stdout)
    head, *lines = (tmp_path / "run" / "curve.csv").read_text().splitlines()
    assert len(curve) == len(lines) and list(curve[0]) == head.split(",")
    assert {"samples", "success", "episodes", "rho"} <= set(curve[0])


def test_ctrl_c_saves_a_checkpoint_and_prints_the_resume_command(tmp_path, tiny, monkeypatch):
    from hil.cli import training

    plain = training._Display.__call__

    def interrupted(self, numbers):
        plain(self, numbers)
        if numbers["samples"] == 256:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(training._Display, "__call__", interrupted)
    out = tmp_path / "run"
    before = signal.getsignal(signal.SIGINT)
    result = runner.invoke(app, ["train", "--recipe", tiny, "--seed", "4", "--out", str(out)])
    assert result.exit_code == 130
    assert signal.getsignal(signal.SIGINT) is before
    command = result.stdout.strip().splitlines()[-1].split()
    assert command[:3] == ["perch-hil", "policy", "train"] and command[-1] == "--resume"
    assert torch.load(out / "checkpoint.pt", weights_only=True)["total"] == 256
    again = runner.invoke(app, command[1:])
    assert again.exit_code == 0, again.output
    assert (out / "curve.csv").read_text().splitlines()[-1].startswith("512,")


def test_non_finite_training_exits_with_3(tmp_path, tiny, monkeypatch):
    from policies.training.learners.dagger import Dagger

    def diverged(self):
        raise ValueError("an action is not finite; the policy has diverged")

    def write_infinity(self):
        with torch.no_grad():
            self.actor.head.bias[0] = float("inf")
        return diverged(self)

    monkeypatch.setattr(Dagger, "step", write_infinity)
    result = runner.invoke(app, ["train", "--recipe", tiny, "--out", str(tmp_path / "run")])
    assert result.exit_code == 3
    assert "weights actor.head.bias" in result.output and "Traceback" not in result.output
