import json

import pytest
from typer.testing import CliRunner

from hil.cli.main import app, parse_seeds
from scenarios.spec import list_scenarios

runner = CliRunner()


def test_seeds_are_one_or_a_range_with_both_ends():
    assert list(parse_seeds(None, None)) == [0]
    assert list(parse_seeds(7, None)) == [7]
    assert list(parse_seeds(None, "3..5")) == [3, 4, 5]


@pytest.mark.parametrize("text", ["", "3", "3..", "..5", "5..3", "a..b", "-1..2", "0..4294967296", "1...3"])
def test_a_bad_range_of_seeds_says_what_is_wrong(text):
    with pytest.raises(ValueError, match="seeds"):
        parse_seeds(None, text)


def test_seed_and_seeds_together_are_refused():
    with pytest.raises(ValueError, match="not both"):
        parse_seeds(1, "0..2")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["hard-1"], 'did you mean "hard-i"'),
        (["hard-i", "--rig", "simm"], 'did you mean "sim"'),
        (["hard-i", "--policy", "plannr"], "use vision, state, planner, planner-analytic"),
        (["hard-i", "--policy", "nowhere.onnx"], "does not exist"),
        (["hard-i", "--seeds", "5..1"], "run upwards"),
        (["no/such/file.toml"], "cannot be read"),
    ],
)
def test_a_users_mistake_is_one_line_exit_2_and_leaves_nothing(tmp_path, capsys, arguments, says):
    result = runner.invoke(app, ["run", *arguments, "--out", str(tmp_path / "runs")])
    assert result.exit_code == 2
    lines = result.output.strip().splitlines()
    assert len(lines) == 1
    assert says in lines[0]
    assert not (tmp_path / "runs").exists()


def test_a_typo_in_a_scenario_names_file_key_and_what_is_allowed(tmp_path):
    from scenarios.spec import FOLDER

    broken = tmp_path / "mine.toml"
    broken.write_text((FOLDER / "hard_i.toml").read_text().replace("inclination_deg", "inclinaton_deg"))
    result = runner.invoke(app, ["run", str(broken), "--out", str(tmp_path / "runs")])
    assert result.exit_code == 2
    assert "mine.toml" in result.output
    assert 'unknown key "board.inclinaton_deg"; did you mean "inclination_deg"?' in result.output


def test_scenarios_are_listed_as_table_and_as_json():
    table = runner.invoke(app, ["scenarios"])
    assert table.exit_code == 0
    assert all(name in table.output for name in list_scenarios())
    listed = json.loads(runner.invoke(app, ["scenarios", "--json"]).stdout)
    assert [s["name"] for s in listed] == list_scenarios()


def test_diff_of_what_is_no_run_is_one_line(tmp_path):
    result = runner.invoke(app, ["diff", str(tmp_path), str(tmp_path)])
    assert result.exit_code == 2
    assert "no run folder" in result.output


def test_the_board_is_written_at_true_size_and_a_wrong_suffix_refused(tmp_path):
    assert runner.invoke(app, ["board", str(tmp_path / "board.svg")]).exit_code == 0
    assert "420" in (tmp_path / "board.svg").read_text()
    assert runner.invoke(app, ["board", str(tmp_path / "board.gif")]).exit_code == 2
