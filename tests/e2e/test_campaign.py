"""A small campaign, from the command line to its page."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from hil.recording.runs import list_runs

PERCH_HIL = [sys.executable, "-c", "from hil.cli.main import main; main()"]
ASKED = [
    "campaign",
    "simple-i",
    "--policy",
    "planner",
    "--policy",
    "planner-analytic",
    "--camera",
    "model",
    "--jobs",
    "1",
]


def test_campaign_is_stopped_resumed_counted_and_compared(tmp_path):
    out = tmp_path / "mine"
    command = [*PERCH_HIL, *ASKED, "--seeds", "0..2", "--out", str(out)]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "seed 0" in line:
            break
    os.killpg(process.pid, signal.SIGINT)
    _, output = process.communicate(timeout=120)
    assert process.returncode == 130 and "Traceback" not in output
    assert output.splitlines()[-1] == "perch-hil: interrupted; the same command goes on from here"
    done = [run for run in list_runs(out) if run.manifest["state"] == "finished"]
    assert 1 <= len(done) < 6

    result = subprocess.run([*command, "--json"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert f"{len(done)} of 6 flights are in" in result.stderr
    report = json.loads(result.stdout)
    assert [(row["policy"], row["runs"]) for row in report["counts"]] == [("planner", 3), ("planner-analytic", 3)]
    (compared,) = report["comparisons"]
    assert (compared["policy"], compared["against"]) == ("planner-analytic", "planner")
    assert "Policies on the same seeds" in (out / "campaign.html").read_text()
    manifests = [run.manifest for run in list_runs(out) if run.manifest["state"] == "finished"]
    assert all(manifest["autopilot"]["not_default"] for manifest in manifests)


def _living(group: int) -> list[str]:
    """What still runs of a process group."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has just gone
            name, _, rest = path.read_text().rpartition(")")
            state, _, its_group = rest.split()[:3]
            if int(its_group) == group and state != "Z":
                found.append(name)
    return found


def test_killed_campaign_leaves_no_flight_running(tmp_path):
    command = [*PERCH_HIL, *ASKED, "--seeds", "0..19", "--out", str(tmp_path / "mine")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stderr is not None
    for line in process.stderr:
        if "seed 0" in line:
            break
    assert len(_living(process.pid)) >= 2
    process.kill()
    process.wait(timeout=30)
    until = time.monotonic() + 20.0
    while left := _living(process.pid):
        assert time.monotonic() < until, left
        time.sleep(0.1)
    process.stderr.close()


def test_usage_errors_exit_2(tmp_path):
    for more, message in (
        (["--seeds", "5"], "write A..B"),
        (["--rig", "field"], "real devices"),
        (["--policy", "planner"], "given twice"),
    ):
        command = [*PERCH_HIL, *ASKED[:-2], *more, "--out", str(tmp_path / "x")]  # jobs: the default
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        assert result.returncode == 2 and message in result.stderr and result.stderr.count("\n") == 1
    assert not (tmp_path / "x").exists()
