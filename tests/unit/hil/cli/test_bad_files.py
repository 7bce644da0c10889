"""A file of the user that cannot be used, through each command that reads it: one line that names it, exit code 2."""

import pytest
from typer.testing import CliRunner

from hil.assembly.rig import RIG_DIR
from hil.cli.main import app
from scenarios.spec import FOLDER as SCENARIOS

RIG, SCENARIO = (RIG_DIR / "sim.toml").read_text(), (SCENARIOS / "hard_i.toml").read_text()
DEEP = "x = " + "[" * 5000


def scenario(old, new):
    assert old in SCENARIO
    return SCENARIO.replace(old, new)


FILES = [
    (["run"], scenario("[board]", "[board]\nsize = 0.5"), "board's side is 0.42 m"),
    (["run"], scenario("[board]", "[board]\nsize = 0.84"), "board's side is 0.42 m"),
    (["run"], scenario("[start]", "[start]\ndepression_max_deg = 1e-300"), "depression_max_deg"),
    (["run"], scenario("[start]", "[start]\ndepression_max_deg = 1e-7"), "depression_max_deg"),
    (["run"], DEEP, "nested more than 64 deep"),
    (["campaign"], DEEP, "nested more than 64 deep"),
    (["rig", "check"], 'title = "mine"\n[vehicle]\nairframe = "paper_qad"', "did you mean 'paper_quad'"),
    (["rig", "check"], 'title = "mine"\n[vehicle]\nairframe = "nowhere.toml"', "nowhere.toml: cannot be read"),
    (["rig", "check"], 'title = "mine"\n[vehicle]\nhover_speed = "0.1"', "vehicle.hover_speed"),
    (["rig", "check"], 'title = "mine"\n[policy]\nkind = "visoin"', "visoin"),
    (["rig", "check"], 'title = "mine"\n[policy]\nkind = "nowhere.onnx"', "nowhere.onnx"),
    (["rig", "check"], DEEP, "nested more than 64 deep"),
    (["run", "hard-i", "--rig"], 'title = "mine"\n[gate]\nrate = "3.0"', "gate.rate"),
    (["run", "hard-i", "--rig"], 'title = "mine"\n[camera.calibration]\ncx = inf', "calibration.cx"),
    (["run", "hard-i", "--rig"], DEEP, "nested more than 64 deep"),
    (["check"], DEEP, "nested more than 64 deep"),
    (["check", "preflight", "--rig"], DEEP, "nested more than 64 deep"),
    (["policy", "train", "--recipe"], DEEP, "nested more than 64 deep"),
]


@pytest.mark.parametrize(("command", "text", "message"), FILES, ids=lambda value: str(value)[:30])
def test_bad_file_is_refused_with_one_line_and_exit_code_2(tmp_path, command, text, message):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    more = ["--out", str(tmp_path / "runs")] if command[0] == "run" else []
    result = CliRunner().invoke(app, [*command, str(path), *more])
    lines = result.output.strip().splitlines()
    assert (result.exit_code, len(lines)) == (2, 1), result.output
    assert message in lines[0]
    assert not (tmp_path / "runs").exists()
