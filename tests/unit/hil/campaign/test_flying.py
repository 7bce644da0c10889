"""One flight by a worker: what failed is told apart from a miss, and the user's files go with it."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from hil.campaign import flying
from hil.campaign.evaluating import Evaluating
from hil.campaign.flying import Flying
from hil.campaign.grid import Grid, Job, Result, check, left_to_do
from hil.campaign.workers import delivery
from hil.campaign.workers.delivery import deliver
from hil.campaign.workers.shipment import Shipment
from hil.campaign.workers.work import Place
from hil.recording.provenance import Code
from hil.recording.runs import RunError, list_runs
from policies.evaluation.contenders import open_contender
from policies.evaluation.evaluate import fly_cases, points
from policies.flying.shipped import CHECKPOINTS
from tests.paths import ROOT

CODE = Code("git", "0.1.0", "a" * 40)
JOB = Job("simple-i", "planner-analytic", 0)


@pytest.fixture
def grid(tmp_path):
    return Grid(("simple-i",), ("planner-analytic",), range(1), "sim", "model", "none", tmp_path / "out")


@pytest.mark.parametrize(
    ("ended", "expected"),
    [
        (RunError("the disk is full"), Result(JOB, failure="the disk is full")),
        (SimpleNamespace(failure="no GPS", flight_class=None), Result(JOB, "missed", (), "no GPS")),
    ],
)
def test_flight_without_an_attempt_counts_as_failure_and_not_as_miss(grid, monkeypatch, ended, expected):
    def fly(*_, **__):
        if isinstance(ended, Exception):
            raise ended
        run = SimpleNamespace(recording=grid.out / "none")
        return SimpleNamespace(
            **vars(ended), interrupted=False, run=run, score=SimpleNamespace(verdict="missed", reasons=())
        )

    monkeypatch.setattr(flying, "fly", fly)
    assert Flying.of(grid, [JOB], CODE)(JOB, Place(grid.out)) == expected


def test_interrupted_flight_is_no_result(grid, monkeypatch):
    monkeypatch.setattr(flying, "fly", lambda *_, **__: SimpleNamespace(interrupted=True))
    with pytest.raises(KeyboardInterrupt):
        Flying.of(grid, [JOB], CODE)(JOB, Place(grid.out))


def test_users_files_are_shipped_and_the_run_that_comes_back_is_the_one_that_was_wanted(grid, tmp_path, monkeypatch):
    """Policy, rig, airframe and recorded motion are gone from here when the flight is flown."""
    mine = tmp_path / "mine"
    mine.mkdir()
    shutil.copy(CHECKPOINTS / "vision.onnx", mine / "mine.onnx")
    shutil.copy(ROOT / "vehicle" / "quadrotor" / "airframes" / "paper_quad.toml", mine / "paper_quad.toml")
    rig = (ROOT / "hil" / "assembly" / "rigs" / "sim.toml").read_text()
    (mine / "rig.toml").write_text(rig.replace('"paper_quad"', f'"{mine / "paper_quad.toml"}"'))
    lines = [f"{t / 10:g},{t / 20:g},0,0" for t in range(400)]
    (mine / "drive.csv").write_text("\n".join(["t,x,y,heading", *lines]))
    simple = (ROOT / "scenarios" / "simple_i.toml").read_text()
    (mine / "scenario.toml").write_text(_with_recorded_path(simple, mine / "drive.csv"))
    grid = replace(
        grid, scenarios=(str(mine / "scenario.toml"),), policies=(str(mine / "mine.onnx"),), rig=str(mine / "rig.toml")
    )
    jobs = check(grid)
    work = Flying.of(grid, jobs, CODE)
    sent = Shipment.of(work, {})
    wanted = left_to_do(grid, jobs)
    assert wanted == jobs and {Path(name).name for name in sent.files} == {"mine.onnx", "paper_quad.toml", "drive.csv"}
    mine.rename(tmp_path / "away")
    (tmp_path / "machine").mkdir()
    monkeypatch.setattr(delivery, "ROOT", tmp_path / "machine")
    monkeypatch.setattr(delivery, "_versions", dict)
    found = deliver(sent, jobs[0])
    assert found.answer.failure == "" and found.answer.job == jobs[0]
    (tmp_path / "away").rename(mine)
    found.keep(grid.out)
    assert left_to_do(grid, jobs) == []
    (run,) = list_runs(grid.out)
    assert run.manifest["policy"]["path"] == str(mine / "mine.onnx")
    assert run.manifest["scenario"]["path"]["file"] == str(mine / "drive.csv")


def _with_recorded_path(scenario, file):
    """The scenario's text with a board that moves as `file` says."""
    kept, table = [], ""
    for line in scenario.splitlines():
        table = line if line.startswith("[") else table
        if not table.startswith(("[path", "[speed")):
            kept.append(line)
    return "\n".join([*kept, "[path]", 'kind = "recorded"', f'file = "{file}"', "[speed]", 'kind = "recorded"', ""])


def test_a_worker_evaluates_as_this_process_does():
    contender = open_contender("state")
    cases = points(contender.config("state", 7, limit=100), 10, ("T1", "T3"))
    work = Evaluating("state", "paper")
    rows = [work(case, Place(work.out)) for case in cases]
    assert str(rows) == str(fly_cases(contender.policy, cases))  # as text: a mean over no success is no number
    assert work.files == {} and Evaluating("mine.onnx", "paper").files == {"mine.onnx": Path("mine.onnx")}
