"""The page's tables are those of the committed data, and say so where an experiment was not measured."""

import pytest

from hil.results.experiments import EXPERIMENTS
from hil.results.measure import files, kept
from hil.results.page import TABLES, PageError, figures, fill
from tests.paths import ROOT

PAGE = ROOT / "docs" / "results.md"
BLOCK = "<!-- results: {} -->\n<!-- end -->\n"


def committed():
    found = {experiment.name: kept(experiment, ROOT / "results") for experiment in EXPERIMENTS}
    return {name: one for name, one in found.items() if one is not None}


def flights(policy, scenario, perched, missed):
    row = {"policy": policy, "scenario": scenario, "impact_normal": -0.5}
    return [{**row, "verdict": "perched"}] * perched + [{**row, "verdict": "missed"}] * missed


def test_page_holds_the_tables_of_the_committed_data():
    page = PAGE.read_text(encoding="utf-8")
    assert fill(page, {name: one["data"] for name, one in committed().items()}) == page
    assert all(f"<!-- results: {name} -->" in page for name in TABLES)


def test_committed_data_was_measured_with_the_networks_that_ship():
    shipped = {each.name: files(each) for each in EXPERIMENTS}
    assert {name: one["files"] for name, one in committed().items()} == {name: shipped[name] for name in committed()}
    assert not [name for name, one in committed().items() if one["code"]["dirty"]]


def test_flights_are_counted_by_policy_and_scenario():
    data = flights("vision", "hard-i", 19, 1) + flights("planner", "hard-i", 0, 20)
    filled = fill(BLOCK.format("scenarios-published"), {"scenarios-published": data})
    (vision,) = [line for line in filled.splitlines() if line.startswith("| `vision`")]
    (planner,) = [line for line in filled.splitlines() if line.startswith("| `planner`")]
    assert "| 19 of 20 |" in vision and "| 19 of 20 (75.1-99.9 %) |" in vision
    assert "| 0 of 20 |" in planner
    assert filled.count("0.50") == 2, "mean speed into the board, on Hard-I and over all, of the flights that perched"


def test_table_without_data_names_the_command_that_measures_it():
    filled = fill(BLOCK.format("state-points"), {})
    assert "Not measured yet (`perch-hil results` does it): state, fast-perching, fast-perching-ctrv." in filled
    assert "T1, the paper | 99.92" in filled


def test_unknown_table_is_an_error():
    with pytest.raises(PageError, match="no table 'speeds'"):
        fill(BLOCK.format("speeds"), {})


def test_each_trajectory_is_flown_by_the_network_that_was_trained_on_it():
    def motions(rates):
        return {
            "motions": [{"name": f"{k} 1 m/s 0 deg", "success": v, "interval_95": (0, 100)} for k, v in rates.items()]
        }

    data = {
        "perchrl-line": motions({"line": 90.0, "spline": 11.0}),
        "perchrl-spline": motions({"line": 12.0, "spline": 80.0}),
    }
    filled = fill(BLOCK.format("trajectories"), data)
    lines = [line for line in filled.splitlines() if "m/s" in line]
    assert [line.split("|")[1:4] for line in lines] == [
        [" spline 1 m/s 0 deg ", " 80.00 (0.0-100.0) ", " - "],
        [" line 1 m/s 0 deg ", " 90.00 (0.0-100.0) ", " - "],
    ]
    assert "perchrl-racetrack" in filled and "perchrl-line" not in filled, "what is missing is named"


def test_ablations_are_compared_by_the_end_of_their_curves():
    end = {"samples": 2e6, "phase": 0.0, "episodes": 50.0}
    begin = {"samples": 1e6, "phase": 0.0, "episodes": 0.0, "success": None, "rho": None}
    data = {"ablation-full": [begin, {**end, "success": 0.9, "rho": 0.97}]}
    filled = fill(BLOCK.format("ablations"), data)
    assert "| PerchRL | 90.0 | 0.970 |" in filled and "../results/ablation-rho.svg" in filled
    assert {name: picture.count("<polyline") for name, picture in figures(data).items()} == {
        "ablation-success.svg": 1, "ablation-rho.svg": 1,
    }  # fmt: skip
    assert figures({}) == {} and ".svg" not in fill(BLOCK.format("ablations"), {})
