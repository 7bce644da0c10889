"""Which process of a live run goes first when there are fewer cores than work.

The kernel weighs sessions before it weighs processes (sched_autogroup): a service has a session of its own, so that
its nice value alone counts for nothing. Whoever computes is left alone until his slice of some milliseconds is over,
unless who wakes up has a shorter one (EEVDF, from Linux 6.12). Both are asked for; what is not permitted, or not known
to this kernel, is left out, and the machine has to be idle enough.
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
    """`nice` of the process and of its session; `slice_ns` 0: the kernel's own."""

    nice: int
    slice_ns: int = 0


# A step of control takes a fraction of a millisecond and somebody waits for it. A picture takes several to be drawn
# and several to be searched: these two are not chopped up. The recorder has time.
CONTROL = Priority(-15, 300_000)
PRIORITIES = {"detector": Priority(-13), "camera": Priority(-11), "recorder": Priority(-9)}

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
    if wanted.slice_ns:
        _take_slice(wanted.slice_ns)


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
