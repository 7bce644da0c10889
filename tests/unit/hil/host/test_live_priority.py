"""Asking to go first: where it is permitted it is so, where not nothing happens; never for somebody's shell."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hil.host.live_priority import CONTROL, PRIORITIES

ASK = """
import os, sys
from hil.host.live_priority import take_priority
take_priority(sys.argv[1])
try:
    session = open("/proc/self/autogroup").read().split()[-1]
except OSError:
    session = "none"
print(os.getpriority(os.PRIO_PROCESS, 0), session)
"""


def ask(service, *, own_session):
    said = subprocess.run(
        [sys.executable, "-c", ASK, service], capture_output=True, text=True, check=True, start_new_session=own_session
    )
    return said.stdout.split()


def permitted():
    code = "import os; os.setpriority(os.PRIO_PROCESS, 0, -1)"
    return subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


@pytest.mark.parametrize("service", ["brain", "detector", "camera", "recorder"])
def test_a_service_takes_what_it_may(service):
    nice, session = ask(service, own_session=True)
    wanted = PRIORITIES.get(service, CONTROL).nice
    before = os.getpriority(os.PRIO_PROCESS, 0)
    assert int(nice) == (wanted if permitted() else before)
    assert session in (str(wanted), "none", "0")


@pytest.mark.skipif(not Path("/proc/self/autogroup").exists(), reason="this kernel weighs no sessions")
def test_the_session_of_a_shell_is_left_alone():
    before = Path("/proc/self/autogroup").read_text().split()[-1]
    assert ask("brain", own_session=False)[1] == before
    assert Path("/proc/self/autogroup").read_text().split()[-1] == before


def test_what_somebody_waits_for_goes_first():
    order = [CONTROL, *(PRIORITIES[name] for name in ("detector", "camera", "recorder"))]
    assert [one.nice for one in order] == sorted({one.nice for one in order})
