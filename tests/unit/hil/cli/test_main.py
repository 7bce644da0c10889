import inspect
import json
import os
import subprocess
import sys
from importlib import metadata

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from hil.cli import main
from hil.cli.main import app
from hil.cli.options import COULD_NOT_RUN, parse_seeds
from policies.flying.shipped import FLYABLE
from scenarios.spec import list_scenarios
from tests.paths import ROOT

runner = CliRunner()


def test_seeds_are_one_or_a_range_with_both_ends():
    assert list(parse_seeds(None, None)) == [0]
    assert list(parse_seeds(7, None)) == [7]
    assert list(parse_seeds(None, "3..5")) == [3, 4, 5]


@pytest.mark.parametrize("text", ["", "3", "3..", "..5", "5..3", "a..b", "-1..2", "0..4294967296", "1...3"])
def test_error_of_an_invalid_seed_range_names_the_fault(text):
    with pytest.raises(ValueError, match="seeds"):
        parse_seeds(None, text)


def test_seed_and_seeds_together_are_refused():
    with pytest.raises(ValueError, match="not both"):
        parse_seeds(1, "0..2")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["hard-1"], 'did you mean "hard-i"'),
        (["hard-i", "--rig", "simm"], 'did you mean "sim"'),
        (["hard-i", "--policy", "plannr"], "use vision, planner, planner-analytic"),
        (["hard-i", "--policy", "nowhere.onnx"], "does not exist"),
        (["hard-i", "--seeds", "5..1"], "run upwards"),
        (["no/such/file.toml"], "cannot be read"),
    ],
)
def test_usage_error_is_one_line_exit_2_and_leaves_no_run(tmp_path, capsys, arguments, message):
    result = runner.invoke(app, ["run", *arguments, "--out", str(tmp_path / "runs")])
    assert result.exit_code == 2
    lines = result.output.strip().splitlines()
    assert len(lines) == 1
    assert message in lines[0]
    assert not (tmp_path / "runs").exists()


def test_scenario_error_names_file_key_and_allowed_values(tmp_path):
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


def test_diff_of_a_folder_without_a_run_is_a_one_line_error(tmp_path):
    result = runner.invoke(app, ["diff", str(tmp_path), str(tmp_path)])
    assert result.exit_code == 2
    assert "no run folder" in result.output


def test_the_board_is_written_at_true_size_and_a_wrong_suffix_refused(tmp_path):
    assert runner.invoke(app, ["board", str(tmp_path / "board.svg")]).exit_code == 0
    assert "420" in (tmp_path / "board.svg").read_text()
    assert runner.invoke(app, ["board", str(tmp_path / "board.gif")]).exit_code == 2
    result = runner.invoke(app, ["board", str(tmp_path / "board.pdf"), "--paper", "A4"])
    assert result.exit_code == 0 and "6 pages of A4" in result.output
    assert runner.invoke(app, ["board", str(tmp_path / "board.svg"), "--paper", "A4"]).exit_code == 2
    assert runner.invoke(app, ["board", str(tmp_path / "board.pdf"), "--paper", "A4", "--charuco"]).exit_code == 2


def call(*arguments):
    return runner.invoke(app, list(arguments))


def test_version_is_the_installed_distributions():
    result = call("--version")
    assert (result.exit_code, result.stdout) == (0, f"perch-hil {metadata.version('perch-hil')}\n")


@pytest.mark.parametrize(
    ("group", "command"),
    [
        *(("bus", name) for name in ("keys", "hub", "node", "status")),
        *(("runs", name) for name in ("diff", "replay", "recover", "report", "view")),
        *(("policy", name) for name in ("train", "evaluate")),
    ],
)
def test_a_grouped_command_and_its_flat_name_are_one_function(group, command):
    tree = get_command(app)
    flat = tree.commands[command]
    assert flat.hidden
    assert inspect.unwrap(flat.callback) is inspect.unwrap(tree.commands[group].commands[command].callback)
    usage = [call(*words, "--help").stdout.partition("\n")[2] for words in ((command,), (group, command))]
    assert usage[0] == usage[1]


def test_runs_without_a_subcommand_lists_runs(tmp_path):
    for words in (["runs", str(tmp_path)], ["runs", "list", str(tmp_path)]):
        assert call(*words).stdout == f"0 runs in {tmp_path}\n"
    assert call("runs", "--verdict", "lucky").exit_code == 2
    assert json.loads(call("runs", str(tmp_path), "--json").stdout) == []


@pytest.mark.parametrize(
    "words", [[], ["run"], ["campaign", "fly"], ["check"], ["bus", "node"], ["runs", "replay"], ["policy", "evaluate"]]
)
def test_help_names_every_policy_that_can_fly(words):
    reported = "".join(call(*words, "--help").stdout.split())  # help texts are broken at spaces and hyphens
    assert ",".join(FLYABLE) in reported and "PATH.onnx" in reported


def test_command_help_is_not_truncated_at_80_columns():
    for words in ([], ["runs"], ["bus"], ["policy"], ["rig"]):
        listed = call(*words, "--help").stdout.partition("Commands:")[2]
        assert listed and "..." not in listed and max(map(len, listed.splitlines())) <= 80


OPTIONS = {"--json": "print JSON on stdout", "--endpoint": "address of", "--records": "folder of the signed"}


def test_option_has_the_same_help_in_every_command():
    found = {name: set() for name in OPTIONS}
    for command in commands(get_command(app)):
        for option in command.params:
            for name in OPTIONS.keys() & set(option.opts):
                assert OPTIONS[name] in option.help, (command.name, name)
                found[name].add(command.name)
            other_words = {"--connect", "--checks", "--hub"} | ({"--listen"} if command.name != "px4" else set())
            assert not other_words & set(option.opts), command.name
    assert {"run", "fly", "check", "scenarios", "list", "diff", "status", "evaluate"} <= found["--json"]
    assert {"run", "check", "hub", "node", "status"} <= found["--endpoint"]
    assert found["--records"] == {"run", "check"}


def commands(command):
    """Every command below `command`, but groups."""
    inner = getattr(command, "commands", None)
    return [command] if inner is None else [found for one in inner.values() for found in commands(one)]


@pytest.mark.parametrize("words", [["scenarios"], ["rig", "list"], ["rig", "check", "sim"], ["check", "--names"]])
def test_json_output_is_one_value_on_stdout(words):
    result = call(*words, "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)
    assert result.stdout.count("\n") == 1


def test_a_checklist_that_cannot_be_used_is_one_line_and_exit_2(tmp_path):
    result = call("check", "prefligt", "--records", str(tmp_path))
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("perch-hil: ") and 'did you mean "preflight"' in result.stderr
    assert result.stderr.count("\n") == 1


def test_an_unexpected_error_ends_with_could_not_run(monkeypatch, capsys):
    def broken():
        raise RuntimeError("a table is missing")

    monkeypatch.setattr(main, "app", broken)
    with pytest.raises(SystemExit) as end:
        main.main()
    assert end.value.code == COULD_NOT_RUN
    assert "RuntimeError: a table is missing" in capsys.readouterr().err


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_a_closed_output_ends_with_could_not_run(tmp_path, closed):
    reading, writing = os.pipe()
    os.close(reading)
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, closed: writing}
    command = ["run", "simple-i", "--policy", "planner", "--camera", "model", "--pictures", "none", "--json"]
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "hil", *command, "--out", tmp_path, "--seeds", "0..1"],
            cwd=ROOT,
            check=False,
            **streams,
        )
    finally:
        os.close(writing)
    assert ended.returncode == COULD_NOT_RUN
