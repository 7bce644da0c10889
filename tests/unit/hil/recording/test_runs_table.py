import csv
import io
import json
import sys
from dataclasses import fields

import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

from hil.cli.runs import register
from hil.recording import runs_table
from hil.recording.runs_table import Row, TableError, rows, select, table, write_csv, write_parquet

METRICS = {
    "planar": 0.012,
    "normal_alignment_deg": 3.5,
    "impact_tangential": 0.2,
    "impact_normal": -0.5,
    "duration": 4.0,
}


def make(root, name, *, scenario="hard-i", policy=None, rig="sim", attached=None, within=False, outcome="fail"):
    folder = root / name
    folder.mkdir(parents=True)
    manifest = {
        "identity": "sim",
        "state": "finished",
        "seed": 3,
        "host": "lockstep",
        "policy": policy or {"name": "planner"},
        "scenario": {"name": scenario},
        "rig": {"name": rig, "title": "all simulated"},
        "code": {"commit": "abc", "dirty": False},
        "wall_clock": {"started_utc": "2026-01-02T03:04:05.000+00:00"},
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    if attached is not None:
        score = {"attached": attached, "within_tolerance": within, "outcome": outcome, "reasons": ["a", "b"]}
        (folder / "score.json").write_text(json.dumps({**score, "metrics": METRICS if attached else {}}))
    return folder


@pytest.fixture
def root(tmp_path):
    root = tmp_path / "runs"
    onnx = {"name": "p.onnx", "sha256": "deadbeef" * 8}
    make(root, "1", attached=True, within=True)
    make(root, "2", attached=True, scenario="simple-i", policy=onnx)
    make(root, "3", attached=False, rig="bench")
    make(root, "4", attached=False, outcome="incomplete")
    make(root, "5")
    make(root, "9", attached=False, within=True)
    cut_short = make(root, "A", attached=True, within=True) / "manifest.json"
    cut_short.write_text(cut_short.read_text().replace("finished", "interrupted"))
    (make(root, "6") / "manifest.json").write_text("{")
    (make(root, "7") / "manifest.json").write_text("{}")
    (make(root, "8", attached=True) / "score.json").write_text('{"metrics": 3}')
    (root / "notes").mkdir()
    return root


def names(found):
    return "".join(row.run for row in found)


def test_every_run_has_one_verdict_beside_a_damaged_run(root):
    assert {row.run: row.verdict for row in rows(root)} == {
        "1": "perched",
        "2": "attached, outside tolerance",
        "3": "missed",
        "4": "incomplete",
        "5": "none",
        "6": "damaged",
        "7": "damaged",
        "8": "damaged",
        "9": "missed",  # within tolerance, but the magnet did not hold
        "A": "incomplete",  # interrupted: its verdict is no measure of the policy
    }


@pytest.mark.parametrize(
    ("filters", "left"),
    [
        ({}, "123456789A"),
        ({"scenario": "simple-i"}, "2"),
        ({"scenario": "Hard_I"}, "13459A"),
        ({"rig": "bench"}, "3"),
        ({"policy": "planner"}, "13459A"),
        ({"policy": "p.onnx"}, "2"),
        ({"policy": "DEADBEEF"}, "2"),
        ({"verdict": "perched"}, "1"),
        ({"verdict": "damaged"}, "678"),
        ({"verdict": "attached"}, "2"),
        ({"scenario": "hard-i", "verdict": "missed"}, "39"),
    ],
)
def test_runs_are_selected_by_filters(root, filters, left):
    assert names(select(rows(root), **filters)) == left


def test_unknown_verdict_filter_is_refused(root):
    with pytest.raises(ValueError, match='did you mean "perched"'):
        select(rows(root), verdict="perchd")


def test_csv_has_every_column_and_the_numbers_unrounded(root, tmp_path):
    write_csv(tmp_path / "t.csv", rows(root))
    with (tmp_path / "t.csv").open(newline="") as file:
        read = list(csv.DictReader(file))
    assert list(read[0]) == [field.name for field in fields(Row)]
    assert (read[0]["planar_m"], read[0]["reasons"], read[4]["planar_m"]) == ("0.012", "a; b", "")


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1", "@SUM(A1)", "\tx", "\rx"])
def test_a_csv_cell_that_begins_like_a_formula_is_text(tmp_path, name):
    write_csv(tmp_path / "t.csv", [Row("run", policy=name, planar_m=-0.5)])
    with (tmp_path / "t.csv").open(newline="") as file:
        (read,) = csv.DictReader(file)
    assert (read["policy"], read["planar_m"]) == (f"'{name}", "-0.5")


def test_names_in_the_table_are_escaped_for_terminal_and_markup():
    console = Console(file=io.StringIO(), width=200, force_terminal=False)
    console.print(table([Row("a\x1b[2J\x1b]0;title\x07", policy="[red]p\x9b31m", verdict="perched")]))
    text = console.file.getvalue()
    assert "a\\x1b[2J\\x1b]0;title\\x07" in text and "[red]p\\x9b31m" in text
    assert all(c.isprintable() or c == "\n" for c in text)


def test_parquet_has_the_same_rows_with_types(root, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    write_parquet(tmp_path / "t.parquet", rows(root))
    read = parquet.read_table(tmp_path / "t.parquet").to_pylist()
    assert [Row(**row) for row in read] == rows(root)
    write_parquet(tmp_path / "empty.parquet", [])
    assert parquet.read_table(tmp_path / "empty.parquet").num_rows == 0


def test_parquet_without_pyarrow_is_one_clear_line(root, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(TableError, match="pip install pyarrow, or use --csv"):
        write_parquet(tmp_path / "t.parquet", rows(root))


def test_unwritable_table_raises_a_clear_error(root, tmp_path):
    with pytest.raises(TableError, match="cannot be written"):
        write_csv(tmp_path / "no" / "t.csv", rows(root))


def test_runs_table_fits_80_columns(root):
    console = Console(width=80, record=True, force_terminal=False)
    console.print(table(rows(root)))
    assert max(map(len, console.export_text().splitlines())) <= 80


class TestCommand:
    app = typer.Typer()
    register(app)

    def call(self, *arguments):
        return CliRunner().invoke(self.app, ["runs", *map(str, arguments)])

    def test_runs_command_lists_filters_and_exports(self, root, tmp_path):
        result = self.call(root, "--verdict", "perched", "--csv", tmp_path / "t.csv")
        assert result.exit_code == 0
        assert "1 run in" in result.output
        assert len((tmp_path / "t.csv").read_text().splitlines()) == 2

    def test_runs_command_without_runs_is_not_an_error(self, tmp_path):
        result = self.call(tmp_path / "none")
        assert (result.exit_code, "0 runs" in result.output) == (0, True)

    def test_runs_command_errors_have_their_exit_codes(self, root, tmp_path, monkeypatch):
        assert self.call(root, "--verdict", "x").exit_code == 2
        monkeypatch.setitem(sys.modules, "pyarrow", None)
        assert self.call(root, "--parquet", tmp_path / "t").exit_code == 3

    def test_recover_command_names_a_folder_without_a_run(self, tmp_path):
        result = CliRunner().invoke(self.app, ["recover", str(tmp_path)])
        assert (result.exit_code, "no run folder" in result.output) == (2, True)


def test_every_verdict_of_the_rows_is_a_known_one(root):
    assert {row.verdict for row in rows(root)} <= set(runs_table.VERDICTS)
