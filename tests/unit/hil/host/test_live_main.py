"""A service that hangs does not outlive its supervisor for ever."""

import os
import subprocess
import sys
import time
from pathlib import Path

CHILD = """
import sys
from hil.host.live_main import last_resort
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


def test_a_hanging_service_ends_itself_when_its_supervisor_is_gone():
    said = subprocess.run(
        [sys.executable, "-c", PARENT, CHILD], capture_output=True, text=True, check=True, timeout=120
    )
    pid, until = int(said.stdout), time.monotonic() + 30.0
    try:
        while alive(pid):
            assert time.monotonic() < until
            time.sleep(0.05)
    finally:
        if alive(pid):
            os.kill(pid, 9)
