"""Whole runs, from the command line to the folder they leave."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hil.assembly.plan import Plan
from hil.assembly.rig import load_rig
from hil.cli.main import app
from hil.host.flight import fly
from hil.host.replay import replay_run
from hil.recording import provenance
from hil.recording.diff import diff_runs
from hil.recording.reader import Recording
from hil.recording.runs import list_runs, open_run
from scenarios.spec import list_scenarios, load

PATIENCE_S = 120  # a cold cache compiles kernels first
PERCH_HIL = [sys.executable, "-c", "from hil.cli.main import main; main()"]


@pytest.fixture(scope="module")
def code():
    """Computed once, so that an edit during the tests does not change it between two runs."""
    return provenance.code()


def in_stages(path):
    """Every message of a recording with the stage it was published in."""
    stage = "prepare"
    for entry in Recording(path).messages():
        if entry.topic == "run/stage":
            stage = entry.message.name
        yield stage, entry


@pytest.mark.parametrize("name", list_scenarios())
def test_every_scenario_flies_and_leaves_a_complete_run(name, tmp_path):
    arguments = ["run", name, "--camera", "model", "--json", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code in (0, 1), result.output
    row = json.loads(result.stdout)
    rig = load_rig(load(name).rig)
    assert (row["scenario"], row["camera"]) == (name, "model" if rig.policy.knows == "camera" else "mocap")
    assert row["within_tolerance"] == (result.exit_code == 0)
    (run,) = list_runs(tmp_path)
    assert str(run.path) == row["run_dir"]
    left = {p.name for p in run.path.iterdir()} - {"dirty.patch"}
    assert left == {"manifest.json", "receipts.mcap", "run.mcap", "score.json"}

    manifest, score = run.manifest, run.score
    assert (manifest["state"], manifest["identity"], manifest["seed"]) == ("finished", "sim", 0)
    assert manifest["scenario"]["name"] == name
    assert score is not None
    metrics = score["metrics"]
    assert metrics["inclination_deg"] == load(name).board.inclination_deg
    assert metrics["duration"] > 0.5
    assert metrics["commands"] > 50
    of_camera = [value for name, value in metrics.items() if name.startswith("perception_")]
    assert all(value > 0.0 for value in of_camera) if rig.policy.knows == "camera" else of_camera == [None] * 3
    made_contact = score["outcome"] == "success"
    for of_contact in ("x", "y", "planar", "normal_alignment_deg", "impact_normal", "impact_tangential"):
        assert metrics[of_contact] is not None or not made_contact
    assert all(math.isfinite(value) for value in metrics.values() if isinstance(value, float))
    check_invariants(run.path, rig)


def check_invariants(path, rig):
    """Checks what is true of every simulated flight, for every outcome."""
    recording = Recording(path)
    assert (recording.complete, recording.faults) == (True, [])
    counts = recording.counts()
    silent = {"camera/image", "event", "run/fault"} | ({"board/detection"} if rig.policy.knows == "mocap" else set())
    assert all(counts[f"/perch/{topic}"] for topic in ("truth/vehicle", "vehicle/odometry", "vehicle/sent", "belief"))
    assert not [t for t, n in counts.items() if n == 0 and t.removeprefix("/perch/") not in silent and "/perch/" in t]
    limits, engaged_at, last_odometry, tripped = rig.gate, None, None, ""
    for stage, entry in in_stages(path):
        message = entry.message
        if entry.topic in ("policy/action", "vehicle/sent"):
            assert stage == "attempt", f"{entry.topic} in stage {stage}"
        if entry.topic == "vehicle/sent":
            assert all(abs(rate) <= limits.rate for rate in message.body_rate)
            assert 0.0 <= message.thrust_normalised <= 1.0
            assert not tripped, "nothing is sent after the gate has tripped"
            tripped = message.tripped
            engaged_at = engaged_at or entry.log_ns
        if entry.topic == "truth/vehicle" and stage == "lead":
            assert math.hypot(*message.velocity) < 0.1, "hands over from a standing hover"
        if entry.topic == "vehicle/odometry":
            assert message.stamp_ns <= entry.log_ns
            if stage == "attempt" and last_odometry is not None:
                assert message.stamp_ns - last_odometry < 30_000_000
            last_odometry = message.stamp_ns
    assert engaged_at is not None


def flown_with_pictures(seed, out, code):
    plan = Plan("simple-i", "sim", None, "pictures")
    flight = fly(
        plan.scenario,
        plan.rig,
        plan.make_policy(),
        seed,
        policy_name=plan.policy_name,
        rig_name="sim",
        pictures="preview",
        out=out,
        code=code,
        progress=lambda now_ns, stage: None,
    )
    assert flight.failure == ""
    assert flight.counters["bytes of garbage on the vehicle's wire"] == 0
    return flight


def test_scenario_with_pictures_perches(tmp_path, code):
    # Several seeds, because another processor rounds differently and a single flight hangs on the last bit.
    scores = [flown_with_pictures(seed, tmp_path, code).score for seed in (3, 4, 5, 6)]
    assert sum(score.within_tolerance for score in scores) >= 3, [score.reason for score in scores]


def test_second_run_with_pictures_on_two_threads_is_equal_byte_for_byte(tmp_path, code, monkeypatch):
    runs = []
    for threads in (1, 2):
        monkeypatch.setattr("hil.host.flight.get_num_threads", lambda threads=threads: threads)
        runs.append(flown_with_pictures(3, tmp_path / str(threads), code))
    one, two = runs
    result = diff_runs(one.run.path, two.run.path)
    assert result.identical, result.lines()
    assert result.messages > 10_000


def test_flights_of_different_seeds_differ(tmp_path):
    arguments = ["run", "simple-i", "--camera", "model", "--seeds", "1..2", "--json", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    one, two = (json.loads(line) for line in result.stdout.splitlines())
    assert (one["seed"], two["seed"]) == (1, 2)
    assert not diff_runs(one["run_dir"], two["run_dir"]).same_messages


def test_with_raw_pictures_the_detector_can_be_replayed(tmp_path):
    arguments = ["run", "simple-i", "--pictures", "raw", "--json", "--out", str(tmp_path)]
    report = json.loads(CliRunner().invoke(app, arguments).stdout)
    found = replay_run(report["run_dir"], ["detector"])
    assert found.same, found.lines()
    assert any("board/detection" in line for line in found.lines())


def interrupt(out, signal_number):
    """Start a flight, send it a signal once a part is on disk; (exit code, stderr, the run's folder)."""
    process = subprocess.Popen(
        [*PERCH_HIL, "run", "simple-i", "--camera", "pictures", "--out", str(out)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        # a shell that put the tests into the background has SIGINT ignored, and children inherit that
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL) and None,
    )
    try:
        deadline = time.monotonic() + PATIENCE_S
        while sum(path.stat().st_size for path in Path(out).glob("*/run.mcap")) < 200_000:
            assert process.poll() is None, process.communicate()[1]
            assert time.monotonic() < deadline
            time.sleep(0.02)
        process.send_signal(signal_number)
        stderr = process.communicate(timeout=PATIENCE_S)[1]
    finally:
        process.kill()
    (folder,) = (path for path in Path(out).iterdir() if not path.name.startswith("."))
    return process.returncode, stderr, folder


def test_ctrl_c_leaves_a_finished_recording_and_reports_it(tmp_path):
    exit_code, stderr, folder = interrupt(tmp_path, signal.SIGINT)
    assert exit_code == 130, stderr
    assert "Traceback" not in stderr
    assert folder.name in stderr.replace("\n", "")
    run = open_run(folder)
    assert run.manifest["state"] == "interrupted"
    assert run.score is not None
    recording = Recording(folder)
    assert (recording.complete, recording.faults) == (True, [])
    assert sum(recording.counts().values()) > 1000


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL is POSIX")
def test_killed_run_leaves_a_readable_recording_up_to_the_last_flush(tmp_path):
    exit_code, _, folder = interrupt(tmp_path, signal.SIGKILL)
    assert exit_code == -signal.SIGKILL
    run = open_run(folder)
    assert (run.manifest["state"], run.score) == ("running", None)
    recording = Recording(folder)
    assert not recording.complete
    assert any("not finished" in fault or "cut off" in fault for fault in recording.faults)
    stamps = [entry.log_ns for entry in recording.messages(["truth/vehicle"])]
    assert len(stamps) > 250
    assert stamps == sorted(stamps)


@pytest.mark.parametrize(
    ("arguments", "expected_text"),
    [
        (["easy-iii"], "easy-iii"),
        (["simple-i", "--rig", "no_such_rig"], "no_such_rig"),
        (["simple-i", "--policy", "magic"], "magic"),
        (["simple-i", "--policy", "{tmp}/broken.onnx"], "broken.onnx"),
        (["simple-i", "--rig", "{tmp}/rig.toml"], "vehicel"),
        (["simple-i", "--seed", "-1"], "-1"),
        (["simple-i", "--seed", "1", "--seeds", "1..2"], "not both"),
        (["{tmp}/scenario.toml"], "scenario.toml"),
    ],
)
def test_usage_error_is_one_line_exit_2_and_leaves_no_file(arguments, expected_text, tmp_path):
    (tmp_path / "broken.onnx").write_bytes(b"\x08\x07 not a network")
    (tmp_path / "rig.toml").write_text('title = "mine"\n[vehicel]\nkind = "sim"\n')
    (tmp_path / "scenario.toml").write_text('name = "mine"\n[path\n')
    out = tmp_path / "runs"
    given = [argument.format(tmp=tmp_path) for argument in arguments]
    result = CliRunner().invoke(app, ["run", *given, "--out", str(out)])
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    (line,) = result.stderr.strip().splitlines()
    assert line.startswith("perch-hil: ")
    assert expected_text in line
    assert not out.exists()
