"""What `make bench` writes, at tiny sizes: its shape, and no time of any kind."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import benchmarks.__main__ as bench
from benchmarks import bench_env, bench_growth
from benchmarks.bench_growth import Growth

TINY = bench.Sizes(
    seeds=(0,), cameras=("model",), rows=8, seconds=0.03, ticks=20, flights=0, cold=False,
    growth=((2, 4), (1, 2), (1, 3), (1, 2)),
)  # fmt: skip


@pytest.mark.slow
def test_bench_writes_machine_load_rows_shares_and_growth(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(bench_env, "PEER_PYTHON", Path("no such python"))
    monkeypatch.setattr(bench_growth, "_ROWS", 8)
    monkeypatch.setattr(bench, "Sizes", lambda: TINY)
    monkeypatch.setattr("sys.argv", ["bench", "--out", str(tmp_path / "bench.json")])
    bench.main()
    found = json.loads((tmp_path / "bench.json").read_text())
    assert set(found) == {"machine", "load", "peer", "rows", "shares", "growth"}
    assert found["machine"]["cores"] > 0
    assert found["peer"] is None
    rows = {row["what"]: row for row in found["rows"]}
    assert all(set(row) == {"what", "value", "unit", "mark", "aim", "less", "samples", "met"} for row in rows.values())
    lockstep = rows["lockstep, hard-i, camera model, real-time factor"]
    assert lockstep["value"] == lockstep["samples"][0] > 0.0
    assert rows["state against crazyflow's"]["value"] is None
    assert rows["state against crazyflow's"]["met"] is None
    assert sum(found["shares"]["model"].values()) == pytest.approx(100.0)
    assert "policy" in found["shares"]["model"]
    assert [len(one["sizes"]) == len(one["seconds"]) for one in found["growth"]] == [True] * 5
    shown = capsys.readouterr().out
    assert all(what in shown for what in rows)
    assert all(one["what"] in shown for one in found["growth"])


def test_a_row_is_met_at_its_mark_and_by_the_side_that_counts():
    assert bench.Row("factor", 4.0, "x", 4.0).met is True
    assert bench.Row("factor", 3.9, "x", 4.0).met is False
    assert bench.Row("time", 3.9, "s", 4.0, less=True).met is True
    assert bench.Row("time", 4.1, "s", 4.0, less=True).met is False
    assert bench.Row("without a mark", 1.0, "s").met is None


@pytest.mark.parametrize(
    ("power", "offset", "linear"), [(1.0, 0.0, True), (1.0, 5.0, True), (0.5, 0.0, True), (1.5, 0.0, False)]
)
def test_growth_is_called_linear_by_its_larger_sizes(power, offset, linear):
    sizes = (1, 10, 100, 1000)
    growth = Growth("cost", sizes, tuple(offset + size**power for size in sizes))
    assert growth.linear is linear


def test_the_largest_memory_of_a_process_is_its_own_and_not_that_of_its_parent():
    held = np.ones(75_000_000)
    code = "from benchmarks.bench_growth import largest_memory_mb; print(largest_memory_mb())"
    child = float(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout)
    assert 10.0 < child < bench_growth.largest_memory_mb() - held.nbytes / 2**20 / 2
