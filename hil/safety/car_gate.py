"""The car's safety gate: the last check of a command before the car's wire. Pure: no clock, no I/O.

Limits clip, what cannot be clipped trips, and a trip latches, as for the vehicle. After a trip nothing more is sent,
and the car stops by its own 500 ms watchdog.
"""

from __future__ import annotations

import math

from hil.contract.messages import CarCommand, CarFeedback
from hil.safety.limits import CarGateLimits
from kernel.stamps import later_than_now


class CarGate:
    """The car's gate. `check` returns what may be sent, or None if nothing may; a trip latches."""

    def __init__(self, limits: CarGateLimits) -> None:
        self._limits = limits
        self.tripped = ""
        self.refused = 0

    def check(self, now_ns: int, command: CarCommand, car: CarFeedback | None) -> CarCommand | None:
        """`command` within the limits; `car` is its newest feedback, None before the first."""
        if self.tripped:
            return None
        self.tripped = self._trip(now_ns, command, car)
        if self.tripped:
            return None
        limits = self._limits
        if not 0 <= now_ns - command.stamp_ns <= limits.command_age_ms * 1e6:
            self.refused += 1
            return None
        speed = min(limits.speed, max(-limits.speed, command.speed))
        turn_rate = min(limits.turn_rate, max(-limits.turn_rate, command.turn_rate))
        return CarCommand(command.stamp_ns, speed, turn_rate)

    def _trip(self, now_ns: int, command: CarCommand, car: CarFeedback | None) -> str:
        limits = self._limits
        if not (math.isfinite(command.speed) and math.isfinite(command.turn_rate)):
            return "command is not finite"
        if car is None or not car.stamp_ns:
            return ""  # no feedback yet, and the driver sends nothing before the first
        if now_ns - car.stamp_ns > limits.feedback_age_ms * 1e6:
            return f"no feedback of the car for {limits.feedback_age_ms:g} ms"
        if later_than_now(car.stamp_ns, now_ns):
            return f"feedback of the car is stamped {(car.stamp_ns - now_ns) * 1e-6:.1f} ms later than now"
        if not (math.isfinite(car.speed) and math.isfinite(car.turn_rate)):
            return "feedback of the car is not finite"
        if abs(car.speed) > limits.measured_speed:
            return f"car at {car.speed:.1f} m/s, limit {limits.measured_speed:g}"
        if abs(car.turn_rate) > limits.measured_turn_rate:
            return f"car turns at {car.turn_rate:.1f} rad/s, limit {limits.measured_turn_rate:g}"
        return ""
