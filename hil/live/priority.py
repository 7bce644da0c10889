"""Scheduling priority of each process of a live run, for machines with fewer cores than work."""

# Where it is permitted, services run in real time (SCHED_FIFO): a service that wakes up then gets a core at once. Where
# it is not, they set a nice value. The kernel weighs sessions before processes (sched_autogroup), and each service has
# a session of its own, so that the session's nice value has to be set too. A running process keeps its core until its
# time slice of some milliseconds is over, unless the process that wakes up has a shorter slice (EEVDF, from Linux
# 6.12). A setting that is not permitted, or not supported by this kernel, is left out; the machine must then be idle
# enough.

from __future__ import annotations

import ctypes
import os
import struct
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from hil.assembly.node_table import PriorityClass


class Priority(NamedTuple):
    """`nice` of the process and of its session; `slice_ns` 0: the kernel's own. `real_time`: SCHED_FIFO's, 0: none.

    `during_step`: SCHED_FIFO's while a node steps, 0: the same as `real_time`.
    """

    nice: int
    slice_ns: int = 0
    real_time: int = 0
    during_step: int = 0


# A control step takes a fraction of a millisecond and another process waits for it. Rendering a picture and
# detecting the tags in it take several milliseconds each: these two keep the kernel's default slice. A rendered
# picture is not due before its read-out would end; its publication then precedes everything except control.
# Services that are not on the path from the picture to the motors come after the detector: before it, they delayed
# one picture in ten by 1.5 ms. The recorder can wait, but not for long: with the lowest priority of all it waited
# for a core during 61 % of a soak.
PRIORITIES: dict[PriorityClass, Priority] = {
    "control": Priority(-15, 300_000, 30),
    "detection": Priority(-13, real_time=20),
    "off_path": Priority(-12, 300_000, 15),
    "rendering": Priority(-11, real_time=22, during_step=10),
    "recording": Priority(-9, real_time=5),
}

_TRIES = 20
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}  # Linux system call numbers; the C library has no wrapper
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")  # size, policy, flags, nice, priority, runtime, deadline, period


def take_priority(priority: PriorityClass) -> None:
    """Request the priority of this class from the kernel, for this thread and those it starts from now on."""
    wanted = PRIORITIES[priority]
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, wanted.nice)
    if os.getsid(0) == os.getpid():  # otherwise it is the session of the user's shell
        _weigh_session(wanted.nice)
    if wanted.real_time and _run_in_real_time(wanted.real_time):
        return
    if wanted.slice_ns:
        _take_slice(wanted.slice_ns)


def drop_priority() -> None:
    """Give back what `take_priority` got for this thread, which only waits from now on; threads that it has started
    keep theirs. Otherwise an endless loop in it would take a core from all services."""
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, 0, 0)


class StepPriority:
    """A context in which this thread has the priority that its class has during a step. Made after `take_priority`."""

    def __init__(self, priority: PriorityClass) -> None:
        wanted = PRIORITIES[priority]
        changes = wanted.during_step and os.sched_getscheduler(0) == os.SCHED_FIFO
        self._usual, self._during = (wanted.real_time, wanted.during_step) if changes else (0, 0)

    def __enter__(self) -> None:
        if self._during:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self._during))

    def __exit__(self, *_: object) -> None:
        if self._usual:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self._usual))


def _run_in_real_time(priority: int) -> bool:
    """Whether it was permitted. Never on a single core: a service in an endless loop would stop its supervisor."""
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
        except BlockingIOError:  # without root: ten writes a second for all processes together
            time.sleep(0.1)
        except OSError:
            return


def _take_slice(slice_ns: int) -> bool:
    """Whether the kernel accepted it; a kernel before 6.12 accepts and ignores it."""
    number = _SCHED_SETATTR.get(os.uname().machine)
    if number is None:
        return False
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    attributes = _ATTRIBUTES.pack(_ATTRIBUTES.size, os.SCHED_OTHER, 0, nice, 0, slice_ns, 0, 0)
    return ctypes.CDLL(None, use_errno=True).syscall(number, 0, attributes, 0) == 0
