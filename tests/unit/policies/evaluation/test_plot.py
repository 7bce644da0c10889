"""The learning curve's drawing."""

import re

from policies.evaluation.plot import comparison, learning_curve, percents


def drawn(tmp_path, rows, head="samples,phase,success,episodes"):
    table = tmp_path / "curve.csv"
    table.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    learning_curve(table, tmp_path / "curve.svg", "a title")
    lines = re.findall(r'<polyline points="([^"]*)"', (tmp_path / "curve.svg").read_text())
    return [[float(point.split(",")[0]) for point in line.split()] for line in lines]


def test_curve_shows_nothing_where_single_episodes_stand_behind_it(tmp_path):
    many = [(1000 * k, 0, 0.9, 40) for k in range(10)]
    few = [(10_000 + 1000 * k, 1, 0.0, 1) for k in range(5)]
    raw, smooth = drawn(tmp_path, many + few)
    assert len(raw) == len(smooth) == 10


def test_curve_joins_iterations_until_enough_episodes_stand_behind_a_point(tmp_path):
    rows = [(1000 * k, 0, 0.5, 2) for k in range(1000)]  # a fiftieth of the lines: 21 of 2 episodes
    raw, smooth = drawn(tmp_path, rows)
    assert raw == [] and len(smooth) == 1000 - 9


def test_curve_of_a_run_that_counted_no_episodes_is_drawn(tmp_path):
    raw, smooth = drawn(tmp_path, [(1000 * k, 0, 0.5) for k in range(10)], "samples,phase,success")
    assert len(raw) == len(smooth) == 10


def test_comparison_draws_a_line_and_a_name_for_each_curve():
    lines = [{"samples": 1e5 * k, "phase": 0.0, "episodes": 50.0, "rho": 0.5 + 0.01 * k} for k in range(10)]
    picture = comparison({"with <rho>": lines, "without": lines[:5]}, "rho", "Mean rho")
    points = [line.split() for line in re.findall(r'<polyline points="([^"]*)"', picture)]
    assert [len(line) for line in points] == [10, 5]
    assert ">with &lt;rho&gt;</text>" in picture and ">without</text>" in picture


def test_shares_are_weighed_by_episodes():
    lines = [{"samples": 1.0, "phase": 0.0, "episodes": 90.0, "success": 1.0},
             {"samples": 2.0, "phase": 0.0, "episodes": 10.0, "success": 0.0}]  # fmt: skip
    assert percents(lines, "success") == [100.0, 90.0]
