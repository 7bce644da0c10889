"""A task on another machine: files arrive by digest, other versions are refused, runs come back whole."""

import json
import shutil
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from hil.campaign.workers import delivery
from hil.campaign.workers.delivery import Delivery, deliver
from hil.campaign.workers.shipment import Shipment
from hil.campaign.workers.work import ClusterError
from hil.recording.provenance import Code
from hil.recording.runs import RunError, list_runs, new_run

VERSIONS = {"Python": "3.11.9", "code": "abc"}


class Noting:
    """`Work` that leaves a run which names its file and holds what the file held."""

    def __init__(self, path, out):
        self.name, self.out, self.files = str(path), out, {str(path): path}

    def __call__(self, task, place):
        run = new_run(
            place.out, scenario={"name": "one", "file": place.file(self.name)}, rig={"name": "sim"}, seed=task,
            host="lockstep", policy={"name": "mine"}, simulated=True, started_utc=datetime(2026, 1, 2, tzinfo=UTC),
            code=Code("git", "0.1.0", "a" * 40),
        )  # fmt: skip
        shutil.copy(place.file(self.name), run.path / "copied")
        return task


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Another machine's folder."""
    (tmp_path / "machine").mkdir()
    monkeypatch.setattr(delivery, "ROOT", tmp_path / "machine")
    monkeypatch.setattr(delivery, "_versions", lambda: VERSIONS)
    return tmp_path / "machine"


@pytest.fixture
def shipment(tmp_path):
    """What was sent; the file is then gone from where it was."""
    path = tmp_path / "mine.csv"
    path.write_text("0, 1")
    sent = Shipment.of(Noting(path, tmp_path / "out"), VERSIONS)
    path.unlink()
    return sent


def test_run_comes_back_whole_and_names_files_as_here(machine, shipment, tmp_path):
    found = deliver(shipment, 7)
    assert found.answer == 7 and not list(machine.glob("runs-*"))
    found.keep(tmp_path / "out")
    (run,) = list_runs(tmp_path / "out")
    assert run.manifest["scenario"]["file"] == str(tmp_path / "mine.csv")
    assert (run.path / "copied").read_text() == "0, 1"
    assert run.manifest["wall_clock"]["run"] == run.path.name


def test_runs_of_one_name_are_kept_side_by_side(machine, shipment, tmp_path):
    for _ in range(2):
        deliver(shipment, 7).keep(tmp_path / "out")
    first, second = list_runs(tmp_path / "out")
    assert second.path.name == second.manifest["wall_clock"]["run"] == f"{first.path.name}-2"


def test_machine_of_other_versions_does_nothing_and_says_why(machine, shipment, tmp_path):
    found = deliver(replace(shipment, versions={**VERSIONS, "code": "other"}), 7)
    assert "has code abc and not other" in found.refused and found.runs is None
    assert list(machine.iterdir()) == []


def test_file_that_was_damaged_on_the_way_is_not_used(machine, shipment):
    damaged = {name: replace(file, content=b"0, 2") for name, file in shipment.files.items()}
    with pytest.raises(ValueError, match=r"mine\.csv: was damaged"):
        deliver(replace(shipment, files=damaged), 7)


def test_file_that_cannot_be_read_is_refused_before_anything_is_sent(tmp_path):
    with pytest.raises(ClusterError, match=r"none\.csv: cannot be read"):
        Shipment.of(Noting(tmp_path / "none.csv", tmp_path), VERSIONS)


def test_run_that_cannot_be_kept_leaves_nothing(tmp_path):
    (tmp_path / "out").write_text("a file where the folder should be")
    with pytest.raises(RunError, match="cannot be kept"):
        Delivery(0, {"run": {"manifest.json": json.dumps({"wall_clock": {}}).encode()}}).keep(tmp_path / "out")


def test_run_without_its_last_file_is_not_kept(tmp_path):
    files = {"manifest.json": json.dumps({"wall_clock": {}}).encode(), "a": b"", "a/b": b"a folder that is a file"}
    with pytest.raises(RunError, match="cannot be kept"):
        Delivery(0, {"run": files}).keep(tmp_path / "out")
    assert list_runs(tmp_path / "out") == [] and list((tmp_path / "out").iterdir()) == []
