"""Whether the magnet holds after contact, from odometry alone. Pure: no clock, no I/O.

The referee's verdict says only that the magnet should hold. With its motors idle a vehicle that is held moves with the
board, and one that is not held falls: after the motors' lag its downward acceleration is that of gravity less the idle
thrust. A board that heaves accelerates much less.
"""

from __future__ import annotations

from collections import deque
from typing import Literal

from hil.contract.messages import VehicleState

Hold = Literal["unknown", "held", "falls"]

_DECIDED_NS = 80_000_000  # of idling: a fall of 3 cm at most
_LIMIT_NS = 150_000_000  # without odometry
_SHOCK_NS = 20_000_000  # after contact, in which the odometry says nothing
_WINDOW_NS = 30_000_000  # over which acceleration is measured
_FALL = -3.0  # m/s^2; a board that heaves by 0.15 m in 2 s reaches -1.5
_SINK = -1.0  # m/s; no board goes down as fast


class MagnetCheck:
    """One contact. `judge` is called with every odometry while the motors idle; a decision stands."""

    def __init__(self, now_ns: int) -> None:
        """`now_ns`: the motors idle from now on."""
        self._since_ns = now_ns
        self._samples: deque[tuple[int, float]] = deque()  # (stamp ns, vertical speed m/s) of the window
        self.hold: Hold = "unknown"

    def judge(self, now_ns: int, vehicle: VehicleState | None) -> Hold:
        """`vehicle`: the newest odometry. Held is decided after 80 ms, a fall as soon as it is seen."""
        if self.hold != "unknown":
            return self.hold
        samples = self._samples
        after_ns = samples[-1][0] if samples else self._since_ns + _SHOCK_NS
        if vehicle is not None and vehicle.stamp_ns > after_ns:
            samples.append((vehicle.stamp_ns, vehicle.velocity[2]))
            while len(samples) > 2 and samples[-1][0] - samples[1][0] >= _WINDOW_NS:
                samples.popleft()
        self.hold = self._decide(now_ns)
        return self.hold

    def _decide(self, now_ns: int) -> Hold:
        if self._samples and self._samples[-1][0] - self._samples[0][0] >= _WINDOW_NS:
            (first_ns, before), (last_ns, speed) = self._samples[0], self._samples[-1]
            if (speed - before) / ((last_ns - first_ns) * 1e-9) < _FALL or speed < _SINK:
                return "falls"
            if last_ns - self._since_ns >= _DECIDED_NS:
                return "held"
        return "falls" if now_ns - self._since_ns > _LIMIT_NS else "unknown"
