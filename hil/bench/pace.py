"""The time base of a bench: wall time for real devices, computed time for simulated ones."""

from __future__ import annotations

import time
from collections.abc import Callable

from hil.host.lockstep import Clock

STEP_NS = 2_000_000


class Virtual:
    """Two milliseconds a step, as fast as the simulated devices (`step(now_ns)`) can be computed."""

    live = False

    def __init__(self) -> None:
        self.clock = Clock()
        self.devices: list[Callable[[int], None]] = []

    def __call__(self) -> None:
        self.clock.now_ns += STEP_NS
        for step in self.devices:
            step(self.clock.now_ns)


class Wall:
    """Waits two milliseconds a step; the clock starts at zero."""

    live = True

    def __init__(self) -> None:
        self.clock = Clock()
        self._start_ns = time.monotonic_ns()

    def __call__(self) -> None:
        time.sleep(STEP_NS * 1e-9)
        self.clock.now_ns = time.monotonic_ns() - self._start_ns


Pace = Virtual | Wall
