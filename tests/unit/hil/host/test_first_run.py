"""The first run on a machine: which process compiles what, and what is left for the flight that follows."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from itertools import chain

import pytest

from hil.assembly.node_table import NODES, node_names
from hil.assembly.rig import list_rigs, load_rig
from hil.cli.options import INTERRUPTED
from hil.host import first_run
from hil.host.first_run import Wanted, compile_kernels
from tests.paths import ROOT

MOCAP = Wanted("crazyflie-wall", "crazyflie-sim", "planner", None)


def shares(rig):
    scenario = "crazyflie-wall" if load_rig(rig).policy.knows == "mocap" else "hard-i"
    return first_run._shares(Wanted(scenario, rig, "planner", None))


@pytest.mark.parametrize("rig", list_rigs())
def test_every_node_is_in_one_share_or_is_a_device_stepped_with_its_driver(rig):
    found = list(chain(*shares(rig)))
    missing = set(node_names(load_rig(rig))) - set(found)
    assert len(found) == len(set(found))
    drivers = {NODES[name].drives for name in found}
    assert all(NODES[name].simulates in drivers for name in missing)


def test_the_longest_share_is_begun_first():
    assert shares("sim")[:2] == [("vehicle_link",), ("belief", "policy")]


@pytest.fixture
def done(monkeypatch):
    """The shares that were compiled; nothing is."""
    found = []
    monkeypatch.setattr(first_run, "warm_up", lambda plan, drawn, names: found.append(names))
    return found


def test_one_core_does_every_share_in_order(done, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})  # no helper: it would have the real `warm_up`
    compile_kernels([MOCAP])
    assert done == shares("crazyflie-sim")


def test_several_workers_do_every_share_once(done):
    wanted, taken = [(MOCAP, names) for names in shares("crazyflie-sim")], multiprocessing.Value("i", 0)
    workers = [threading.Thread(target=first_run._work, args=(wanted, taken)) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert sorted(done) == sorted(shares("crazyflie-sim"))


COUNT = """
import json, sys
from numba.core import event
from hil.host.first_run import Wanted, compile_kernels, is_first_run

class Compiled(event.Listener):
    names = []
    def on_start(self, it):
        dispatcher = it.data["dispatcher"]
        self.names.append(f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__name__}")
    def on_end(self, it): pass

def main():
    before = is_first_run()
    compile_kernels([Wanted("crazyflie-wall", "crazyflie-sim", "planner", None)])
    event.register("numba:compile", Compiled())
    from hil.cli.main import main as perch_hil
    sys.argv = ["perch-hil", "run", "crazyflie-wall", "--policy", "planner", "--out", sys.argv[1]]
    try:
        perch_hil()
    finally:
        print("\\n" + json.dumps([before, is_first_run(), Compiled.names]))

if __name__ == "__main__":
    main()
"""


def test_the_flight_after_it_compiles_hardly_anything(tmp_path):
    script = tmp_path / "count.py"
    script.write_text(COUNT)
    environment = {**os.environ, "PERCH_KERNEL_CACHE": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    finished = subprocess.run(
        [sys.executable, script, tmp_path / "runs"], env=environment, capture_output=True, text=True, check=False
    )
    assert finished.returncode in (0, 1), finished.stderr
    before, after, compiled = json.loads(finished.stdout.splitlines()[-1])
    assert before and not after
    assert len(compiled) < 20  # of some 200: what ends a flight and closes its recording


def test_ctrl_c_while_compiling_ends_all_processes_without_a_traceback(tmp_path):
    command = [sys.executable, "-c", "from hil.cli.main import main; main()"]
    command += ["run", "crazyflie-wall", "--policy", "planner", "--out", str(tmp_path / "runs")]
    environment = {**os.environ, "PERCH_KERNEL_CACHE": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as process:
        assert process.stdout is not None
        assert "compiling" in process.stdout.readline()
        time.sleep(1.0)  # the helpers are importing
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them
        said = process.stdout.read()  # ends when the last of them has
    assert process.returncode == INTERRUPTED and "Traceback" not in said and "interrupted" in said
