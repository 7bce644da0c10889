import errno
import hashlib
import json
import subprocess
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime

import pytest

from hil.recording import provenance, runs
from hil.recording.provenance import Code, ProvenanceError
from hil.recording.runs import RunError, list_runs, new_run, open_run, policy_identity, write_json
from policies.prediction.learned import CHECKPOINT

CODE = Code("git", "0.1.0", "a" * 40)
WHEN = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


def make(root, **changes):
    arguments = {
        "scenario": {"name": "hard-i", "source": "hard_i.toml"},
        "rig": {"name": "sim"},
        "seed": 7,
        "host": "lockstep",
        "policy": {"name": "planner"},
        "simulated": True,
        "started_utc": WHEN,
        "code": CODE,
        **changes,
    }
    return new_run(root, **arguments)


def test_new_run_has_a_manifest(tmp_path):
    run = make(tmp_path / "runs", more={"drawn": {"distance": 2.0}})
    assert run.path.name == "20260102T030405Z_hard-i_sim-seed7"
    manifest = run.manifest
    assert manifest["identity"] == "sim"
    assert (manifest["seed"], manifest["host"], manifest["policy"]) == (7, "lockstep", {"name": "planner"})
    assert manifest["code"] == {"source": "git", "version": "0.1.0", "commit": "a" * 40, "dirty": False}
    assert manifest["drawn"] == {"distance": 2.0}
    assert manifest["packages"]["numba"]
    assert manifest["machine"]["cores"] >= 1
    assert manifest["wall_clock"]["started_utc"] == "2026-01-02T03:04:05.000+00:00"
    assert manifest["state"] == "running"
    assert sorted(p.name for p in run.path.iterdir()) == ["manifest.json"]
    assert run.score is None


def test_manifest_says_which_wall_time_the_runs_clock_began_at(tmp_path):
    run = make(tmp_path)
    run.begin(datetime(2026, 1, 2, 3, 4, 6, 250_000, tzinfo=UTC))
    run.finish("finished", datetime(2026, 1, 2, 3, 5, tzinfo=UTC), wall_s=1.0)
    clock = run.manifest["wall_clock"]
    assert (clock["zero_utc"], clock["wall_s"]) == ("2026-01-02T03:04:06.250+00:00", 1.0)
    assert clock["started_utc"] == "2026-01-02T03:04:05.000+00:00"


def test_runs_started_in_the_same_second_get_different_folders(tmp_path):
    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda _: make(tmp_path), range(8)))
    assert len({run.path for run in runs}) == 8
    assert len(list_runs(tmp_path)) == 8
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]
    assert all(run.manifest["wall_clock"]["run"] == run.path.name for run in runs)


def test_simulated_and_real_runs_never_share_a_name(tmp_path):
    names = [make(tmp_path, simulated=s).path.name for s in (True, False, False)]
    assert [n.rpartition("_")[2] for n in names] == ["sim-seed7", "real-001", "real-002"]
    assert open_run(tmp_path / names[1]).manifest["identity"] == "real"


def test_finish_keeps_the_rest_of_the_manifest(tmp_path):
    run = make(tmp_path)
    before = run.manifest
    assert run.finish("finished", WHEN, {"score.json": {"attached": True}}, real_time_factor=1.5) == ""
    after = run.manifest
    assert after["state"] == "finished"
    assert after["wall_clock"]["real_time_factor"] == 1.5
    assert run.score == {"attached": True}
    different = {key for key in after if after[key] != before[key]}
    assert different == {"state", "wall_clock"}


@pytest.mark.parametrize("full_from", ["score.json", "manifest.json"])
def test_run_on_a_full_disk_is_marked_as_failed(tmp_path, monkeypatch, full_from):
    run, write = make(tmp_path), runs.write_json

    def full(path, value):
        if path.name == full_from or full_from == "manifest.json":
            raise OSError(errno.ENOSPC, "No space left on device")
        write(path, value)

    monkeypatch.setattr(runs, "write_json", full)
    fault = run.finish("finished", WHEN, {"score.json": {"attached": True}})
    assert fault == f"{run.path / 'score.json'} cannot be written: No space left on device"
    assert run.manifest["state"] == "failed"
    assert run.score is None


def test_json_that_cannot_be_written_leaves_the_old_file_and_no_scratch(tmp_path, monkeypatch):
    path = tmp_path / "score.json"
    write_json(path, {"a": 1})

    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(runs.os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_json(path, {"a": 2})
    assert [one.name for one in tmp_path.iterdir()] == ["score.json"]
    assert json.loads(path.read_text()) == {"a": 1}


def test_uncommitted_changes_are_kept(tmp_path):
    patch = b"diff --git a/x b/x\n"
    run = make(tmp_path, code=Code("git", "0.1.0", "b" * 40, patch, (("hil/new.py", "c" * 64),)))
    assert (run.path / "dirty.patch").read_bytes() == patch
    code = run.manifest["code"]
    assert code["dirty"]
    assert len(code["diff_sha256"]) == 64
    assert code["untracked"] == {"hil/new.py": "c" * 64}


def test_run_folder_is_not_created_without_complete_provenance(tmp_path):
    root = tmp_path / "runs"
    with pytest.raises(ProvenanceError, match="names of its scenario and of its policy"):
        make(root, policy={})
    with pytest.raises(ProvenanceError, match="cannot be read for its checksum"):
        make(root, policy=policy_identity(str(tmp_path / "missing.onnx")))
    assert not root.exists()


def test_root_that_is_a_file_raises_a_clear_error(tmp_path):
    (tmp_path / "runs").write_text("")
    with pytest.raises(RunError, match="cannot make a run folder"):
        make(tmp_path / "runs")


def test_policy_file_is_identified_by_its_checksum(tmp_path):
    path = tmp_path / "mine.onnx"
    path.write_bytes(b"weights")
    assert policy_identity("planner-analytic") == {"name": "planner-analytic"}
    assert set(policy_identity("vision")) == {"name", "sha256"}  # no path: it comes with the project, wherever that is
    identity = policy_identity(str(path))
    assert identity["name"] == "mine.onnx"
    assert identity["sha256"] == hashlib.sha256(b"weights").hexdigest()
    path.write_bytes(b"other weights")
    assert policy_identity(str(path))["sha256"] != identity["sha256"]


def test_opening_a_folder_without_a_run_raises(tmp_path):
    (tmp_path / "file.mcap").write_bytes(b"")
    with pytest.raises(RunError, match="is a file: give the run's folder"):
        open_run(tmp_path / "file.mcap")
    with pytest.raises(RunError, match="no such run folder"):
        open_run(tmp_path / "nothing")
    with pytest.raises(RunError, match="is no run folder"):
        open_run(tmp_path)
    (tmp_path / "manifest.json").write_text("{half")
    with pytest.raises(RunError, match="is damaged"):
        open_run(tmp_path)
    assert list_runs(tmp_path / "nothing") == []


def test_json_is_written_atomically(tmp_path):
    path = tmp_path / "score.json"
    write_json(path, {"a": 1})
    with pytest.raises(ValueError, match="JSON"):
        write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text()) == {"a": 1}


@pytest.fixture
def repository(tmp_path):
    def git(*arguments):
        identity = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
        subprocess.run(["git", "-C", str(tmp_path), *identity, *arguments], check=True, capture_output=True)

    (tmp_path / "hil").mkdir()
    (tmp_path / "hil" / "a.py").write_text("one\n")
    git("init", "-q")
    git("add", ".")
    git("commit", "-q", "-m", "first")
    return tmp_path


def test_clean_checkout_is_identified_by_its_commit(repository):
    code = provenance.code(repository)
    assert (code.source, code.dirty, len(code.commit)) == ("git", False, 40)


def test_changed_or_new_code_makes_a_checkout_dirty_and_new_runs_do_not(repository):
    (repository / "runs").mkdir()
    (repository / "runs" / "run.mcap").write_text("data")
    assert not provenance.code(repository).dirty
    (repository / "hil" / "b.py").write_text("new\n")
    code = provenance.code(repository)
    assert (code.dirty, code.patch, [name for name, _ in code.untracked]) == (True, b"", ["hil/b.py"])
    (repository / "hil" / "a.py").write_text("two\n")
    assert b"+two" in provenance.code(repository).patch


def test_checkout_without_a_commit_or_git_raises(tmp_path, monkeypatch):
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    with pytest.raises(ProvenanceError, match="git could not tell the origin"):
        provenance.code(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ProvenanceError, match="git is not installed"):
        provenance.code(tmp_path)


def test_provenance_outside_git_is_that_of_the_package_and_noted(tmp_path):
    code = provenance.code(tmp_path)
    assert (code.source, code.version) == ("package", "0.1.0")
    assert "not run from a git checkout" in code.manifest()["note"]
    with pytest.raises(ProvenanceError, match="no git checkout and no package"):
        provenance.code(tmp_path, distribution="no-such-thing")
    with pytest.raises(ProvenanceError, match="is not installed"):
        provenance.packages("no-such-thing")


def test_code_is_identified_by_its_content_package_by_package(tmp_path):
    for name in ("kernel", "hil", "vehicle", "groundcar", "policies", "scenarios"):
        (tmp_path / name / "inner").mkdir(parents=True)
        (tmp_path / name / "inner" / "one.py").write_text("x = 1\n")
    before = provenance.code_digests(tmp_path)
    (tmp_path / "hil" / "__pycache__").mkdir()
    (tmp_path / "hil" / "__pycache__" / "one.pyc").write_bytes(b"x")
    (tmp_path / "hil" / "notes.md").write_text("x")
    assert provenance.code_digests(tmp_path) == before
    (tmp_path / "hil" / "inner" / "one.py").rename(tmp_path / "hil" / "inner" / "two.py")
    after = provenance.code_digests(tmp_path)
    assert {name for name in before if before[name] != after[name]} == {"hil"}


def test_planner_is_identified_with_its_motion_predictor():
    assert policy_identity("planner") == {"name": "planner", "predictor_sha256": provenance.file_sha256(CHECKPOINT)}
