"""A flight flown again: on its recorded motion, from its recorded start; and its twin."""

import json
import math

import numpy as np
import pytest
from typer.testing import CliRunner

from hil.campaign.refly import scenario_again, write_scenario
from hil.cli.main import app
from hil.recording.reader import Recording
from hil.recording.runs import open_run
from kernel.toml_errors import ConfigError
from scenarios.spec import load
from tests.e2e.test_faults import flown


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("first"), scenario="hard-i", seed=3)


def boards(run):
    """Times (s since the car set off) and positions of the true board."""
    recording = Recording(run.recording)
    stage = next(m for _, _, m in recording.messages(["run/stage"]) if m.car_start_ns)
    found = [m for _, _, m in recording.messages(["truth/board"]) if m.stamp_ns >= stage.car_start_ns]
    return np.array([(m.stamp_ns - stage.car_start_ns) * 1e-9 for m in found]), np.array([m.position for m in found])


def test_board_moves_as_it_did_and_the_vehicle_starts_where_it_was(flight, tmp_path):
    result = CliRunner().invoke(
        app,
        [
            "refly",
            str(flight.run.path),
            "--seeds",
            "5..5",
            "--camera",
            "model",
            "--out",
            str(tmp_path / "again"),
            "--json",
        ],
    )
    assert result.exit_code in (0, 1), result.output
    again = open_run(json.loads(result.stdout.splitlines()[-1])["run_dir"])
    (t, first), (u, second) = boards(flight.run), boards(again)
    inside = t < min(t[-1], u[-1])
    errors = [first[inside, k] - np.interp(t[inside], u, second[:, k]) for k in range(3)]
    assert inside.sum() > 200 and np.abs(errors).max() < 0.05

    def start(run):
        recording = Recording(run.recording)
        at = next(m.attempt_start_ns for _, _, m in recording.messages(["run/stage"]) if m.attempt_start_ns)
        return next(m.position for _, _, m in recording.messages(["truth/vehicle"]) if m.stamp_ns >= at)

    assert math.dist(start(flight.run), start(again)) < 0.2
    assert again.manifest["scenario"]["path"]["sha256"]


def test_scenario_that_is_written_is_the_one_that_is_read(flight, tmp_path):
    scenario = scenario_again(flight.run)
    write_scenario(tmp_path / "again.toml", scenario)
    assert load(tmp_path / "again.toml") == scenario


def test_run_that_cannot_be_flown_again_is_refused_in_one_line(flight, tmp_path):
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "manifest.json").write_text((flight.run.path / "manifest.json").read_text())
    (broken / "run.mcap").write_bytes(b"")
    with pytest.raises(ConfigError, match=r"cannot be flown again: .* is empty"):
        scenario_again(open_run(broken))
    result = CliRunner().invoke(app, ["refly", str(tmp_path / "none")])
    assert result.exit_code == 2 and result.stderr.count("\n") == 1


def test_reality_of_a_simulated_run_differs_little(flight, tmp_path):
    result = CliRunner().invoke(app, ["reality", str(flight.run.path), "--out", str(tmp_path / "twins"), "--json"])
    assert result.exit_code == 0, result.output
    rows = {row["name"]: row for row in json.loads(result.stdout)["quantities"]}
    known = [row for row in rows.values() if row["distance"] is not None and row["low"] is not None]
    assert len(known) >= 12
    assert abs(rows["hover thrust"]["distance"]) < 0.1
    assert abs(rows["pitch rate, delay"]["distance"] or 0.0) < 0.03
    assert np.isfinite([row["distance"] for row in known]).all()
