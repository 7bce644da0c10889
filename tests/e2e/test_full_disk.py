"""A run in lockstep on a disk that fills up: one line, exit code 3, and a folder that says so."""

import resource
import shutil
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from hil.cli.main import app
from hil.host import space
from hil.recording import provenance
from hil.recording.provenance import Code
from hil.recording.reader import Recording
from hil.recording.runs import list_runs


@contextmanager
def room(size):
    """No file may grow beyond `size` bytes: the error is that of a file that is too large, its handling the same."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def run(out):
    return CliRunner().invoke(
        app, ["run", "simple-i", "--camera", "model", "--policy", "planner", "--pictures", "none", "--out", str(out)]
    )


@pytest.fixture(autouse=True)
def committed(monkeypatch):
    """The run's folder would hold the uncommitted changes, of any size."""
    monkeypatch.setattr(provenance, "code", lambda: Code("git", "0.1.0", "a" * 40))


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """The kernels of such a run: writing their cache is not what is tried here."""
    folder = tmp_path_factory.mktemp("compiled")
    assert run(folder).exit_code in (0, 1)
    shutil.rmtree(folder)


@pytest.mark.parametrize("size", [20_000, 60_000, 150_000])
def test_run_on_a_full_disk_ends_with_one_line_and_exit_code_3(tmp_path, compiled, size):
    with room(size):
        result = run(tmp_path)
    assert result.exit_code == 3
    assert isinstance(result.exception, SystemExit)
    lines = [line for line in result.output.splitlines() if line.strip()]
    assert len(lines) == 1
    assert lines[0].startswith("perch-hil: ")
    assert lines[0].endswith("File too large")
    (left,) = list_runs(tmp_path)
    assert left.manifest["state"] == "failed"
    recording = Recording(left.recording)
    assert not recording.complete
    assert recording.faults == [fault for fault in recording.faults if "not finished" in fault]


def test_run_without_enough_space_leaves_no_folder(tmp_path, compiled, monkeypatch):
    monkeypatch.setattr(space.shutil, "disk_usage", lambda _: SimpleNamespace(free=10**7))
    result = run(tmp_path / "runs")
    assert result.exit_code == 3
    assert "10 MB are free and a run needs 200 MB" in result.output
    assert not (tmp_path / "runs").exists()
