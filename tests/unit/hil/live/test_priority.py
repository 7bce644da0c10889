"""Process priority: it is set where permitted, and the shell of the user is unchanged."""

import os
import subprocess
import sys

import pytest

from hil.live.priority import PRIORITIES

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


def ask(priority, *, own_session):
    finished = subprocess.run(
        [sys.executable, "-c", ASK, priority], capture_output=True, text=True, check=True, start_new_session=own_session
    )
    return finished.stdout.split()


def permitted(call):
    return subprocess.run([sys.executable, "-c", f"import os; {call}"], capture_output=True).returncode == 0


@pytest.mark.parametrize("priority", ["control", "detection", "off_path", "rendering", "recording"])
def test_process_priority_is_set_as_far_as_permitted(priority):
    nice, real_time, _, session = ask(priority, own_session=True)
    wanted = PRIORITIES[priority]
    before = os.getpriority(os.PRIO_PROCESS, 0)
    assert int(nice) == (wanted.nice if permitted("os.setpriority(os.PRIO_PROCESS, 0, -1)") else before)
    may = permitted("os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))") and os.cpu_count() > 1
    assert int(real_time) == (wanted.real_time if may else 0)
    assert session in (str(wanted.nice), "none", "0")


def test_priority_of_a_shell_session_is_unchanged():
    _, _, before, after = ask("control", own_session=False)
    assert after == before


DURING_STEP = """
import os
from hil.live.priority import StepPriority, take_priority
take_priority("rendering")
during_step = StepPriority("rendering")
priorities = []
for _ in range(2):
    with during_step:
        priorities.append(os.sched_getparam(0).sched_priority)
    priorities.append(os.sched_getparam(0).sched_priority)
print(*priorities)
"""


def test_rendering_has_low_priority_while_drawing_and_high_while_delivering():
    finished = subprocess.run([sys.executable, "-c", DURING_STEP], capture_output=True, text=True, check=True)
    wanted = PRIORITIES["rendering"]
    may = permitted("os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))") and os.cpu_count() > 1
    assert finished.stdout.split() == [str(n) for n in (wanted.during_step, wanted.real_time) * 2] if may else ["0"] * 4


def test_control_has_the_highest_priority_and_the_recorder_the_lowest():
    order = [PRIORITIES[name] for name in ("control", "detection", "off_path", "rendering", "recording")]
    assert [one.nice for one in order] == sorted({one.nice for one in order})
    during_step = [one.during_step or one.real_time for one in order]
    assert during_step == sorted(set(during_step), reverse=True)
