"""What is printed fits 80 columns, row for row, and a pipe."""

import io

import pytest
from rich.console import Console

from hil.bus.status import Status, status_tables
from hil.cli.campaign import _table
from hil.cli.console import run_table, scenarios_table, seeds_table
from hil.cli.policy_table import note_lines, policy_table
from hil.cli.screen import PIPE_WIDTH, print_json, say, screen
from hil.contract.topics import TOPICS
from hil.live.timing import timing_lines
from policies.evaluation.evaluate import Row
from scenarios.spec import list_scenarios, load
from tests.unit.hil.cli.test_console import crash, score

PACE = {"steps": 123456, "late": 12345, "missed": 12345, "worst_ns": 123_456_789}
NODES = {"camera": ["camera"], "brain": ["detector", "belief", "policy"], "vehicle_link": ["vehicle"]}
SUMMARY = {
    "exposure_to_action": {
        "count": 12345, "p50_ms": 20.51, "p90_ms": 21.32, "p99_ms": 123.43, "max_ms": 124.01,
        "histogram_ms": {"20": 12000, "22": 345},
        "to_detection": {"count": 12345, "p50_ms": 19.51, "p99_ms": 121.43},
        "then_to_action": {"count": 12345, "p50_ms": 1.51, "p99_ms": 12.43},
    },
    "of_it_exposure_and_transport_ms": 16.0,
    "load_average": (0.5, 2.5), "cores": 2, "idle": 0.25, "stolen": 0.0,
    "services": {
        service: {"nodes": dict.fromkeys(nodes, PACE), "dropped": {"image": 1200}, "lost": {"odometry": 34}}
        for service, nodes in NODES.items()
    },
    "remarks": [],
}  # fmt: skip


def shown(*what) -> list[str]:
    console = Console(width=80, record=True, file=io.StringIO())
    for one in what:
        console.print(one)
    return console.export_text().splitlines()


def test_live_summary_has_one_line_per_node_of_at_most_80_columns():
    lines = timing_lines(SUMMARY)
    assert max(map(len, lines)) <= 80
    for service, nodes in NODES.items():
        for node in nodes:
            (line,) = [line for line in lines if line.startswith(f"{node:16s} {service} ")]
            assert line.split()[2:] == ["123456", "12345", "12345", "123.5", "1234"]


def test_live_summary_of_a_flight_by_motion_capture_names_no_pictures():
    latency = {**SUMMARY["exposure_to_action"], "to_detection": {"count": 0}, "then_to_action": {"count": 0}}
    lines = timing_lines({**SUMMARY, "exposure_to_action": latency, "of_it_exposure_and_transport_ms": None})
    assert lines[0] == "exposure to action, 12345 measurements by motion capture:"
    assert not any("picture" in line or "camera is" in line or "detection" in line for line in lines)


def test_live_summary_lines_are_not_wrapped_in_a_pipe(capsys):
    say("\n".join(timing_lines(SUMMARY)))
    assert capsys.readouterr().out.splitlines() == timing_lines(SUMMARY)


def test_long_line_is_not_wrapped_in_a_pipe(capsys):
    say("run folder: " + 40 * "long/")
    assert capsys.readouterr().out == "run folder: " + 40 * "long/" + "\n"
    assert screen().width == PIPE_WIDTH


def test_json_has_null_for_non_finite_values(capsys):
    print_json({"a": float("nan"), "b": [1.5, float("inf")], "c": (True, None)})
    assert capsys.readouterr().out == '{"a": null, "b": [1.5, null], "c": [true, null]}\n'


def test_seed_table_has_one_line_per_seed():
    scores = [score(seed, within=False, reasons=("distance", "tangential_speed")) for seed in (999_998, 3)]
    lines = shown(seeds_table(load("hard-i"), [*scores, crash(4)]))
    assert max(map(len, lines)) <= 80
    for seed in ("999998", "3", "4"):
        assert len([line for line in lines if line.split()[:1] == [seed]]) == 1
    assert any("distance; tangential_speed" in line for line in lines)


@pytest.mark.parametrize("name", list_scenarios())
def test_run_and_scenario_tables_fit_80_columns(name):
    assert max(map(len, shown(run_table(score(scenario=name), load(name), real_time_factor=1.0)))) <= 80
    assert max(map(len, shown(scenarios_table([load(name)])))) <= 80


def test_campaign_table_has_one_line_per_group():
    group = {"scenario": "normal-ii", "policy": "planner-analytic", "camera": "pictures", "rig": "", "runs": 100}
    lines = shown(_table([{**group, "within_tolerance": 99, "attached": 100}], 0.95))
    (line,) = [line for line in lines if "normal-ii" in line]
    assert "planner-analytic" in line and "99 of 100 (95-100 %)" in line and "100 of 100" in line


def test_evaluation_has_one_line_per_point_and_lists_failure_causes():
    causes = {"time_limit": 12, "tangential_speed": 3}
    numbers = (2000, 1985, 99.25, 99.9, 1.72, 0.052, 0.061, 0.214, 0.56, 0.31, 0.84, 1.0, 92.0, 0.9)
    rows = [Row(name, *numbers, causes) for name in ("T1", "T3, motors x1.6 slower", "racetrack 3.5 m/s 60 deg")]
    lines = shown(policy_table(rows, "vision", "points, 2000 episodes each"))
    for row in rows:
        (line,) = [line for line in lines if row.name in line]
        assert line.split()[-7:] == ["99.25", "98.8-99.6", "1.72", "0.052", "0.061", "0.21", "0.56"]
    assert max(map(len, lines)) <= 80
    notes = note_lines(rows)
    assert notes[1] == (
        "T3, motors x1.6 slower: into the board at 0.31-0.84 m/s, seen 92 %; failed: time limit 12, tangential speed 3"
    )


def test_status_has_one_line_per_topic():
    service = {"state": "running", "pid": 1234567, "nodes": dict.fromkeys(NODES["brain"], PACE)}
    lines = shown(*status_tables(Status({"brain": service}, dict.fromkeys(TOPICS, (100.0, 5.0)))))
    assert max(map(len, lines)) <= 80
    for topic in TOPICS:
        assert len([line for line in lines if line.split()[:1] == [topic]]) == 1
