"""What makes two runs with a real firmware equal: its threads in a fixed order, and no clock that runs ahead of them.

PX4's threads have one real-time priority (SCHED_FIFO). On a processor of their own they run in the order in which they
were woken, whatever else the machine does; the host keeps off that processor, waits while the firmware boots, and lets
it process what it got before the next sample of its sensors.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

from hil.wires import WireError
from hil.wires.simulator import PORT, SimulatorServer
from vehicle.px4.codec import MESSAGES

_HOLD_S = 4.0  # wall time after the first sample, in which the firmware starts its modules
_SLOW_STEPS, _SLOW_S = 200, 0.03  # samples after it that come slowly
_GAP_S = 0.002  # between a GPS fix and the sample after it
_ID = slice(7, 10)  # of the message, in a MAVLink 2 frame


class ReservedProcessor:
    """A processor for the firmware alone: this process leaves it until `release`."""

    def __init__(self) -> None:
        """Raises WireError if the machine does not permit it."""
        self._before = os.sched_getaffinity(0)
        if len(self._before) < 2:
            raise WireError("deterministic = true needs two processors, one for the firmware; this process may use one")
        _check_priority()
        self.number = max(self._before)
        os.sched_setaffinity(0, self._before - {self.number})

    def release(self) -> None:
        """This process may use it again; may be called twice."""
        os.sched_setaffinity(0, self._before)


def _check_priority() -> None:
    policy = os.sched_getscheduler(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))
    except OSError:
        raise WireError(
            "deterministic = true needs real-time priority for the firmware's threads: run as root, or raise the limit "
            "rtprio of this user to 99"
        ) from None
    os.sched_setscheduler(0, policy, os.sched_param(0))


class SettledServer(SimulatorServer):
    """A `SimulatorServer` that gives the firmware time where its threads would otherwise race."""

    def __init__(
        self, host: str = "127.0.0.1", port: int = PORT, sleep: Callable[[float], object] = time.sleep
    ) -> None:
        super().__init__(host, port)
        self._sleep, self._steps = sleep, 0
        self._sensor = MESSAGES["HIL_SENSOR"].id.to_bytes(3, "little")
        self._gps = MESSAGES["HIL_GPS"].id.to_bytes(3, "little")

    def send(self, data: bytes) -> None:
        """Send `data`, and sleep after it as long as the firmware needs."""
        super().send(data)
        if data[_ID] == self._gps:
            self._sleep(_GAP_S)
        elif data[_ID] == self._sensor and self._steps <= _SLOW_STEPS:
            self._sleep(_SLOW_S if self._steps else _HOLD_S)
            self._steps += 1
