"""Faults of services and of the host: a process that ends or hangs, a clock that steps, a disk that is full."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from hil.faults.fault import Fault, Host, Parameters, Setting
from kernel.toml_errors import nearest


class _Service(Fault):
    """Acts on all nodes of one service."""

    class Parameters(Parameters):
        service: str = "brain"

    @classmethod
    def places(cls, parameters: Any, setting: Setting) -> tuple[str, ...]:
        return setting.services.get(parameters.service, ())

    @classmethod
    def complaint(cls, parameters: Any, setting: Setting) -> str:
        services = tuple(setting.services)
        if parameters.service not in services:
            return f'there is no service "{parameters.service}"{nearest(parameters.service, services)} ' + (
                f"Of this rig: {', '.join(services)}"
            )
        return super().complaint(parameters, setting)


class ServiceKilled(_Service):
    """A service's process ends without a word (SIGKILL); in lockstep its nodes are not stepped from then on."""

    kind, final = "service.killed", True
    dead = True

    def begin(self, host: Host) -> None:
        if self.live:
            os.kill(os.getpid(), signal.SIGKILL)


class ServiceStopped(_Service):
    """A service's process is stopped (SIGSTOP); in lockstep its nodes are not stepped while it lasts."""

    kind = "service.stopped"
    dead = True
    _waker: subprocess.Popen[bytes] | None = None

    def begin(self, host: Host) -> None:
        if not self.live:
            return
        if self.lasts_s is not None:  # a stopped process cannot go on by itself
            wake = f"sleep {self.lasts_s}; kill -CONT {os.getpid()}"
            self._waker = subprocess.Popen(["/bin/sh", "-c", wake])
        os.kill(os.getpid(), signal.SIGSTOP)

    def end(self, host: Host) -> None:
        if self._waker is not None:
            self._waker.wait()


class ServiceStalled(_Service):
    """A service's step takes as long as the fault lasts; what arrives meanwhile waits."""

    kind = "service.stalled"
    stalls = True


class ClockStep(_Service):
    """A service's clock is ahead of the others by `offset_ms`; negative: behind."""

    kind = "clock.step"

    class Parameters(_Service.Parameters):
        offset_ms: Annotated[float, Field(ge=-60_000, le=60_000)] = 200.0

    def __init__(self, parameters: Any, rng: np.ndarray) -> None:
        super().__init__(parameters, rng)
        self.clock_ns = round(parameters.offset_ms * 1e6)


class DiskFull(_Service):
    """A service cannot write another byte to a file."""

    kind, live_only = "disk.full", True

    def begin(self, host: Host) -> None:
        if self.live:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            self._before = resource.getrlimit(resource.RLIMIT_FSIZE)
            resource.setrlimit(resource.RLIMIT_FSIZE, (0, self._before[1]))

    def end(self, host: Host) -> None:
        if self.live:
            resource.setrlimit(resource.RLIMIT_FSIZE, self._before)


KINDS = (ServiceKilled, ServiceStopped, ServiceStalled, ClockStep, DiskFull)
