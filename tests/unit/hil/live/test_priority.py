"""Asking to go first: where it is permitted it is so, where not nothing happens; never for somebody's shell."""

import os
import subprocess
import sys

import pytest

from hil.live.priority import CONTROL, PRIORITIES

# What belongs to no session but the machine's first one, as in a container, reads an empty file.
ASK = """
import os, sys
from hil.live.priority import take_priority
def weight():
    try:
        return (open("/proc/self/autogroup").read().split() or ["none"])[-1]
    except OSError:
        return "none"
before = weight()
take_priority(sys.argv[1])
print(os.getpriority(os.PRIO_PROCESS, 0), os.sched_getparam(0).sched_priority, before, weight())
"""


def ask(service, *, own_session):
    said = subprocess.run(
        [sys.executable, "-c", ASK, service], capture_output=True, text=True, check=True, start_new_session=own_session
    )
    return said.stdout.split()


def permitted(call):
    return subprocess.run([sys.executable, "-c", f"import os; {call}"], capture_output=True).returncode == 0


@pytest.mark.parametrize("service", ["brain", "detector", "mocap", "camera", "recorder"])
def test_a_service_takes_what_it_may(service):
    nice, real_time, _, session = ask(service, own_session=True)
    wanted = PRIORITIES.get(service, CONTROL)
    before = os.getpriority(os.PRIO_PROCESS, 0)
    assert int(nice) == (wanted.nice if permitted("os.setpriority(os.PRIO_PROCESS, 0, -1)") else before)
    may = permitted("os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))") and os.cpu_count() > 1
    assert int(real_time) == (wanted.real_time if may else 0)
    assert session in (str(wanted.nice), "none", "0")


def test_the_session_of_a_shell_is_left_alone():
    _, _, before, after = ask("brain", own_session=False)
    assert after == before


AT_WORK = """
import os
from hil.live.priority import AtWork, take_priority
take_priority("camera")
at_work = AtWork("camera")
priorities = []
for _ in range(2):
    with at_work:
        priorities.append(os.sched_getparam(0).sched_priority)
    priorities.append(os.sched_getparam(0).sched_priority)
print(*priorities)
"""


def test_a_picture_is_drawn_after_others_but_delivered_before_them():
    said = subprocess.run([sys.executable, "-c", AT_WORK], capture_output=True, text=True, check=True)
    wanted = PRIORITIES["camera"]
    may = permitted("os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))") and os.cpu_count() > 1
    assert said.stdout.split() == [str(n) for n in (wanted.at_work, wanted.real_time) * 2] if may else ["0"] * 4


def test_what_somebody_waits_for_goes_first():
    order = [CONTROL, *(PRIORITIES[name] for name in ("detector", "car", "camera", "recorder"))]
    assert [one.nice for one in order] == sorted({one.nice for one in order})
    at_work = [one.at_work or one.real_time for one in order]
    assert at_work == sorted(set(at_work), reverse=True)
