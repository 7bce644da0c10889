import dataclasses
import io
import json
import math

import pytest
from rich.console import Console

from hil.cli.console import _ROWS, json_row, rate_text, run_table, scenarios_table, seeds_table
from hil.scoring.score import Metrics, Score
from scenarios.paper import RealRow
from scenarios.spec import list_scenarios, load, published_row


def score(seed=0, within=True, attached=True, planar=0.05, reasons=(), scenario="hard-i"):
    metrics = Metrics(
        platform_speed=(1.02, 2.61),
        inclination_deg=70.0,
        x=planar,
        y=0.0,
        planar=planar,
        normal_alignment_deg=4.2,
        impact_normal=-0.55,
        impact_tangential=0.12,
        perception_desired_hz=60.0,
        perception_actual_hz=58.8,
        perception_found_hz=31.0,
        inclination_measured_deg=70.01,
        duration=3.2,
        blind_time=0.31,
        detection_latency=0.0265,
        commands=320,
        commands_limited=0,
    )
    return Score(scenario, seed, attached, within, "success" if within else "fail", reasons, metrics)


def crash(seed=1):
    nothing = {
        field: None
        for field in ("x", "y", "planar", "normal_alignment_deg", "impact_normal", "impact_tangential", "blind_time")
    }
    metrics = dataclasses.replace(score().metrics, platform_speed=None, **nothing)
    return Score("hard-i", seed, False, False, "fail", ("ground",), metrics)


def shown(what):
    console = Console(width=140, record=True, file=io.StringIO())
    console.print(what)
    return console.export_text()


def lines(text, start):
    return next(line.split() for line in text.splitlines() if line.strip().startswith(start))


def test_run_table_shows_the_published_row():
    text = shown(run_table(score(), load("hard-i"), real_time_factor=2.345))
    assert lines(text, "platform speed")[-2:] == ["1.02-2.61", "0.70-2.70"]
    assert lines(text, "terminal error, planar")[-3:] == ["0.050", "0.03", "0.20"]
    assert lines(text, "normal alignment")[-3:] == ["4.20", "5.24", "11.46"]
    assert lines(text, "impact velocity, normal")[-2:] == ["-0.55", "-0.47"]
    assert lines(text, "perception, actual")[-2:] == ["58.80", "54.25"]
    assert lines(text, "attached")[-2:] == ["yes", "yes"]
    assert lines(text, "within tolerance")[-2:] == ["yes", "yes"]
    assert "2.35 times real time" in text or "2.34 times real time" in text


def test_attached_and_within_tolerance_are_separate_rows_for_run_and_paper():
    text = shown(run_table(score(within=False), load("normal-i"), real_time_factor=None))
    assert lines(text, "attached")[-2:] == ["yes", "yes"]
    assert lines(text, "within tolerance")[-2:] == ["no", "no"]


def test_missing_value_is_shown_as_a_dash():
    text = shown(run_table(crash(), load("hard-i"), real_time_factor=None))
    assert lines(text, "terminal error x")[-2:] == ["-", "-0.02"]
    assert "why: ground" in text


def test_every_row_is_a_metric_and_the_papers_columns_are_all_there():
    fields = [field for _, _, field, _ in _ROWS]
    assert set(fields) <= {f.name for f in dataclasses.fields(Metrics)}
    assert set(RealRow.model_fields) - {"flights"} <= set(fields)


def test_json_row_has_the_documented_fields():
    spec = load("hard-i")
    row = json_row(
        score(), published_row(spec), policy="planner", camera="pictures", real_time_factor=1.2, run_dir="runs/x"
    )
    again = json.loads(json.dumps(row, allow_nan=False))
    promised = {
        "scenario",
        "seed",
        "policy",
        "camera",
        "attached",
        "within_tolerance",
        "metrics",
        "published",
        "real_time_factor",
        "run_dir",
    }
    assert promised <= set(again)
    assert again["published"]["platform_speed"] == [0.7, 2.7]
    assert again["published"].keys() - {"flights"} <= again["metrics"].keys()
    assert again["metrics"]["planar"] == 0.05
    without = json_row(crash(), None, policy="p", camera="model", real_time_factor=None, run_dir="x")
    assert (without["published"], without["metrics"]["x"]) == ({}, None)


def test_seeds_give_counts_with_their_exact_interval():
    scores = [score(i) for i in range(18)] + [score(18, within=False, reasons=("distance",)), crash(19)]
    text = shown(seeds_table(load("hard-i"), scores))
    assert lines(text, "attached  ")[1:] == ["19", "of", "20", "(75-100", "%)"]
    assert lines(text, "within tolerance  ")[2:] == ["18", "of", "20", "(68-99", "%)"]
    assert "distance" in text
    assert "ground" in text
    assert lines(text, "17")[1:] == ["perched", "0.050", "4.20", "0.12", "-0.55", "3.20"]
    assert lines(text, "19")[1:3] == ["missed", "-"]


def test_rate_text_has_counts_and_interval():
    assert rate_text(18, 20) == "18 of 20 (68-99 %)"
    assert rate_text(0, 0) == "no runs"


def test_scenario_list_describes_each_scenario():
    text = shown(scenarios_table([load(name) for name in list_scenarios()]))
    assert all(name in text for name in list_scenarios())
    assert "spline then arc" in text


def test_a_users_scenario_without_a_published_row():
    spec = load("hard-i").model_copy(update={"published": None})
    text = shown(run_table(score(), spec, real_time_factor=1.0))
    assert published_row(spec) is None
    assert lines(text, "attached")[-1] == "yes"


def test_published_simulation_row_can_be_compared():
    spec = load("hard-i").model_copy(update={"published": "vision.t3"})
    text = shown(run_table(score(), spec, real_time_factor=1.0))
    assert lines(text, "inclination")[-1] == "60.00"
    assert math.isclose(published_row(spec).normal_error, 0.043)


@pytest.mark.parametrize("name", list_scenarios())
def test_every_scenario_can_be_shown(name):
    assert "published" in shown(run_table(score(scenario=name), load(name), real_time_factor=1.0))


def test_a_seed_within_tolerance_that_is_not_attached_is_missed():
    assert lines(shown(seeds_table(load("hard-i"), [score(attached=False)])), "0 ")[1] == "missed"


def test_aborted_run_is_shown_without_a_verdict_and_not_counted():
    aborted = dataclasses.replace(score(seed=1), outcome="incomplete", reasons=("aborted: interrupted",))
    text = shown(seeds_table(load("hard-i"), [score(seed=0), aborted]))
    assert "attached          1 of 1" in text and "aborted: interrupted" in text
    assert lines(text, "1 ")[1] == "incomplete"
    alone = shown(run_table(aborted, load("hard-i"), real_time_factor=None))
    assert lines(alone, "attached")[1] == "-"
    assert json_row(
        aborted, None, policy="planner", camera="model", real_time_factor=None, run_dir="runs/x"
    )["verdict"] == "incomplete"  # fmt: skip
