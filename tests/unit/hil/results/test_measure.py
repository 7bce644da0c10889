"""An experiment is measured by the real command line, kept, and not measured again."""

import json
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from hil.cli.main import app
from hil.results.experiments import Experiment
from hil.results.measure import MeasureError, is_measured, kept, measure

LIST = Experiment(
    "flights", "runs of a folder", ("vision.onnx",), ("scenarios --json", "scenarios --json"), keep=("name",)
)
runner = CliRunner()


@pytest.fixture
def asked(monkeypatch):
    """The arguments of every command that is asked for, which it prints."""
    found = []

    def run(words, **_):
        found.append(words[3:])
        return SimpleNamespace(returncode=0, stdout=json.dumps(words[3:]))

    monkeypatch.setattr("hil.results.measure.subprocess.run", run)
    return found


def test_data_is_kept_with_its_commands_code_and_networks(tmp_path):
    assert not is_measured(LIST, tmp_path)
    measure(LIST, tmp_path, tmp_path / "runs", {"commit": "abc"})
    found = kept(LIST, tmp_path)
    assert {"name": "hard-i"} in found["data"]
    assert (found["code"], list(found["files"])) == ({"commit": "abc"}, ["vision.onnx"])
    assert is_measured(LIST, tmp_path)


@pytest.mark.parametrize("change", [{"commands": ["scenarios"]}, {"files": {"vision.onnx": "0"}}])
def test_other_commands_or_networks_are_measured_again(change, tmp_path):
    measure(LIST, tmp_path, tmp_path / "runs", {})
    path = tmp_path / "flights.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    assert not is_measured(LIST, tmp_path)


def test_commands_that_fly_are_flown_on_the_cluster_and_kept_as_the_same_commands(tmp_path, asked):
    both = Experiment("both", "", (), ("campaign hard-i", "policy evaluate state --json", "runs {runs} --json"))
    measure(both, tmp_path, tmp_path / "runs", {}, "host:1")
    assert [words[-2:] == ["--cluster", "host:1"] for words in asked] == [True, True, False]
    assert is_measured(both, tmp_path)


def test_data_names_no_folder_of_this_machine(tmp_path, asked):
    flown = Experiment("flown", "", (), ("policy evaluate {runs}/policy.onnx --heatmap {results}/map.svg --json",))
    measure(flown, tmp_path / "results", tmp_path / "runs", {})
    found = kept(flown, tmp_path / "results")
    assert found["data"] == ["policy", "evaluate", "{runs}/policy.onnx", "--heatmap", "{results}/map.svg", "--json"]


def test_training_that_was_stopped_goes_on(tmp_path, asked):
    net = Experiment("net", "", (), ("policy train --out {runs}", "policy evaluate {runs}/policy.onnx --json"))
    measure(net, tmp_path, tmp_path / "runs", {})
    (tmp_path / "runs" / "net").mkdir(parents=True)
    (tmp_path / "runs" / "net" / "checkpoint.pt").touch()
    measure(net, tmp_path, tmp_path / "runs", {})
    assert ["--resume" in words for words in asked] == [False, False, True, False]


def test_command_that_fails_is_named_and_leaves_no_data(tmp_path):
    wrong = Experiment("wrong", "", (), ("policy evaluate magic --json",))
    with pytest.raises(MeasureError, match="policy evaluate magic --json: exit code 2"):
        measure(wrong, tmp_path, tmp_path / "runs", {})
    assert kept(wrong, tmp_path) is None


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [(["stat"], 'did you mean "state"'), (["--page", "no.md"], "no.md: no such page")],
)
def test_usage_error_is_one_line_and_exit_2(arguments, expected):
    result = runner.invoke(app, ["results", *arguments])
    assert result.exit_code == 2
    (line,) = result.output.strip().splitlines()
    assert expected in line


def test_list_measures_nothing(tmp_path):
    result = runner.invoke(app, ["results", "--list", "--folder", str(tmp_path)])
    assert result.exit_code == 0
    assert "scenarios-pictures" in result.output and "not measured" in result.output
    assert list(tmp_path.iterdir()) == []
