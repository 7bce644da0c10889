"""A hanging service exits after its supervisor has ended."""

import os
import subprocess
import sys
import time
from pathlib import Path

from hil.live.process import PARENT as STARTED_BY

CHILD = """
import sys
from hil.live.main import last_resort
last_resort(0.2)
print("here", flush=True)
while True:
    pass
"""
PARENT = """
import subprocess, sys
child = subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdout=subprocess.PIPE)
child.stdout.readline()
print(child.pid, flush=True)
"""


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_hanging_service_exits_when_its_supervisor_ends():
    finished = subprocess.run(
        [sys.executable, "-c", PARENT, CHILD], capture_output=True, text=True, check=True, timeout=120
    )
    pid, until = int(finished.stdout), time.monotonic() + 30.0
    try:
        while alive(pid):
            assert time.monotonic() < until
            time.sleep(0.05)
    finally:
        if alive(pid):
            os.kill(pid, 9)


def test_service_exits_at_once_when_its_supervisor_ended_before_the_start(tmp_path):
    """Its parent is then another process, which never changes."""
    code = "import sys; from hil.live import main as live_main; live_main.LiveSpec.read = lambda _: sys.exit('lives'); "
    code += "sys.argv[1:] = ['spec', 'camera']; sys.exit(live_main.main())"
    for parent, printed, ended in ((str(os.getpid()), "lives\n", 1), ("1", "", 3)):
        child = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            env={**os.environ, STARTED_BY: parent},
            timeout=120,
        )
        assert (child.stderr, child.returncode) == (printed, ended)
