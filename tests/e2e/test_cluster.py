"""A campaign on a Ray cluster of two machines (on this one): versions, a stop, a machine that is killed, evaluation."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter

import pytest
from typer.testing import CliRunner

from hil.cli.main import app
from hil.recording.runs import list_runs

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
cluster_utils = pytest.importorskip("ray.cluster_utils")

OTHER = "import hil.campaign.workers.versions as v; v.packages = lambda: {'numba': '0.1'}; "
MAIN = "from hil.cli.main import main; main()"
FLIGHTS = ["campaign", "simple-i", "--policy", "planner", "--policy", "planner-analytic", "--camera", "model"]
SMALL = {"wait": False, "num_cpus": 1, "object_store_memory": 100 << 20}


@pytest.fixture
def machines():
    """A cluster of two Ray nodes with a core each, without a dashboard."""
    cluster = cluster_utils.Cluster(initialize_head=True, head_node_args={**SMALL, "include_dashboard": False})
    folder = cluster.head_node.get_session_dir_path()
    try:
        cluster.add_node(**SMALL)
        cluster.wait_for_nodes(timeout=300)
        yield cluster
    finally:
        cluster.shutdown()
        shutil.rmtree(folder, ignore_errors=True)


def start(words, main=MAIN):
    return subprocess.Popen(
        [sys.executable, "-c", main, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def run(words, main=MAIN):
    return subprocess.run([sys.executable, "-c", main, *words], capture_output=True, text=True, check=False)


def wait_for_flights(process, count):
    """Read its progress until `count` flights are done; returns the lines."""
    seen = []
    assert process.stderr is not None
    while len(seen) < count:
        line = process.stderr.readline()
        assert line, "ended before its flights"
        seen += [line] if " seed " in line else []
    return seen


def finished(out):
    """(policy, seed) of every finished run, counted."""
    runs = [run.manifest for run in list_runs(out)]
    return Counter((run["policy"]["name"], run["seed"]) for run in runs if run["state"] == "finished")


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_no_flight_is_lost_and_none_counted_twice_when_stopped_and_when_a_machine_is_killed(machines, tmp_path):
    out = tmp_path / "campaign"
    there = ["--cluster", machines.address]
    command = [*FLIGHTS, "--seeds", "0..2", "--out", str(out), *there]

    refused = run(command, OTHER + MAIN)
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1, refused.stderr
    assert "has numba" in refused.stderr and "and not 0.1" in refused.stderr and not out.exists()

    process = start(command)
    wait_for_flights(process, 1)
    os.kill(process.pid, signal.SIGINT)
    _, said = process.communicate()
    assert process.returncode == 130 and "Traceback" not in said, said
    assert said.splitlines()[-1] == "perch-hil: interrupted; the same command goes on from here"
    kept = finished(out)
    assert 1 <= len(kept) < 6 and set(kept.values()) == {1}

    process = start(command)
    wait_for_flights(process, 1)
    machines.remove_node(next(iter(machines.worker_nodes)), allow_graceful=False)
    _, said = process.communicate()
    assert process.returncode == 0, said
    assert len(finished(out)) == 6 and set(finished(out).values()) == {1}

    here = CliRunner().invoke(app, command[: -len(there)])
    assert here.exit_code == 0 and " seed " not in here.output, here.output  # nothing is left to fly

    evaluate = ["policy", "evaluate", "state", "--episodes", "10", "--json"]
    assert json.loads(run([*evaluate, *there]).stdout) == json.loads(CliRunner().invoke(app, evaluate).stdout)
