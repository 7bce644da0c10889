"""Which process of a live run goes first when there are fewer cores than work.

Where it is permitted services run in real time (SCHED_FIFO): who waits for his turn then gets it at once, however short
the turn of whoever computes has been. Where it is not, they ask for weight. The kernel weighs sessions before it weighs
processes (sched_autogroup): a service has a session of its own, so that its nice value alone counts for nothing.
Whoever computes is left alone until his slice of some milliseconds is over, unless who wakes up has a shorter one
(EEVDF, from Linux 6.12). What is not permitted, or not known to this kernel, is left out, and the machine has to be
idle enough.
"""

from __future__ import annotations

import ctypes
import os
import struct
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple


class Priority(NamedTuple):
    """`nice` of the process and of its session; `slice_ns` 0: the kernel's own. `real_time`: SCHED_FIFO's, 0: none.

    `at_work`: SCHED_FIFO's during a step, 0: as ever.
    """

    nice: int
    slice_ns: int = 0
    real_time: int = 0
    at_work: int = 0


# A step of control takes a fraction of a millisecond and somebody waits for it. A picture takes several to be drawn and
# several to be searched: these two are not chopped up, and the drawn one is not due before it would have been read out.
# Once it is due it goes before all that is not control.
# Who is not on the way from the picture to the motors comes after the detector: with them before it one picture in ten
# came 1.5 ms later. The recorder has time, but not for ever: left to what the others leave it waited for a core 61 % of
# a soak.
CONTROL = Priority(-15, 300_000, 30)
PRIORITIES = {
    "detector": Priority(-13, real_time=20),
    **dict.fromkeys(("mocap", "car_device", "car", "referee"), Priority(-12, 300_000, 15)),
    "camera": Priority(-11, real_time=22, at_work=10),
    "recorder": Priority(-9, real_time=5),
}

_TRIES = 20
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}  # Linux system call numbers; the C library has no wrapper
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")  # size, policy, flags, nice, priority, runtime, deadline, period


def take_priority(service: str) -> None:
    """Ask for what `service` needs, for this thread and those it starts from now on."""
    wanted = PRIORITIES.get(service, CONTROL)
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, wanted.nice)
    if os.getsid(0) == os.getpid():  # else it is the session of somebody's shell
        _weigh_session(wanted.nice)
    if wanted.real_time and _run_in_real_time(wanted.real_time):
        return
    if wanted.slice_ns:
        _take_slice(wanted.slice_ns)


class AtWork:
    """`with` it this thread has the priority that its service has during a step. To be made after `take_priority`."""

    def __init__(self, service: str) -> None:
        wanted = PRIORITIES.get(service, CONTROL)
        changes = wanted.at_work and os.sched_getscheduler(0) == os.SCHED_FIFO
        self._usual, self._now = (wanted.real_time, wanted.at_work) if changes else (0, 0)

    def __enter__(self) -> None:
        if self._now:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self._now))

    def __exit__(self, *_: object) -> None:
        if self._usual:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self._usual))


def _run_in_real_time(priority: int) -> bool:
    """Whether it was permitted. Never on a single core: a service that runs wild would leave nothing to its judge."""
    if (os.cpu_count() or 1) < 2:
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return False
    return True


def _weigh_session(nice: int) -> None:
    for _ in range(_TRIES):
        try:
            Path("/proc/self/autogroup").write_text(str(nice))
            return
        except BlockingIOError:  # who is not root may ask ten times a second, all together
            time.sleep(0.1)
        except OSError:
            return


def _take_slice(slice_ns: int) -> bool:
    """Whether the kernel took it; one before 6.12 takes it and goes on as ever."""
    number = _SCHED_SETATTR.get(os.uname().machine)
    if number is None:
        return False
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    attributes = _ATTRIBUTES.pack(_ATTRIBUTES.size, os.SCHED_OTHER, 0, nice, 0, slice_ns, 0, 0)
    return ctypes.CDLL(None, use_errno=True).syscall(number, 0, attributes, 0) == 0
