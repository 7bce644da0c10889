"""The vehicle's safety gate: the last check of a command before the vehicle's wire. Pure: no clock, no I/O.

A command outside the limits of rate or thrust is clipped and marked. What cannot be clipped trips the gate: a number
that is not finite; a vehicle that is too fast, tumbling, outside its fence or without fresh odometry; a board that has
not been seen for seconds. A trip latches: nothing more is sent, and the autopilot's own failsafe acts on the missing
commands.
"""

from __future__ import annotations

import math

from hil.contract.messages import Action, Sent, VehicleState
from hil.safety.limits import GateLimits


class VehicleGate:
    """One vehicle's gate. `check` returns what may be sent, or None if nothing may."""

    def __init__(self, limits: GateLimits) -> None:
        self._limits = limits
        self.tripped = ""
        self.refused = 0

    def check(self, now_ns: int, action: Action, vehicle: VehicleState | None) -> Sent | None:
        """`action` against the limits; `vehicle` is the newest odometry. A trip latches; `tripped` names its reason."""
        if self.tripped:
            return None
        self.tripped = self._trip(now_ns, action, vehicle)
        if self.tripped:
            return None
        if not 0 <= now_ns - action.stamp_ns <= self._limits.command_age_ms * 1e6:
            self.refused += 1
            return None
        bound = self._limits.rate
        p, q, r = (min(bound, max(-bound, rate)) for rate in action.body_rate)
        low, high = self._limits.thrust
        thrust = min(high, max(low, action.thrust))
        limited = (p, q, r) != tuple(action.body_rate) or thrust != action.thrust
        return Sent(now_ns, (p, q, r), thrust, 0.0, limited, "")

    def _trip(self, now_ns: int, action: Action, vehicle: VehicleState | None) -> str:
        limits = self._limits
        if not all(map(math.isfinite, (*action.body_rate, action.thrust))):
            return "command is not finite"
        if vehicle is None or now_ns - vehicle.stamp_ns > limits.odometry_age_ms * 1e6:
            return f"no odometry younger than {limits.odometry_age_ms:g} ms"
        blind = (now_ns - action.exposure_ns) * 1e-9
        if blind > limits.blind:
            return f"board not seen for {blind:.1f} s, limit {limits.blind:g}"
        numbers = (*vehicle.position, *vehicle.velocity, *vehicle.orientation, *vehicle.body_rate)
        if not all(map(math.isfinite, numbers)):
            return "odometry is not finite"
        speed = math.hypot(*vehicle.velocity)
        if speed > limits.speed:
            return f"vehicle at {speed:.1f} m/s, limit {limits.speed:g}"
        turning = math.hypot(*vehicle.body_rate)
        if turning > limits.turning:
            return f"vehicle turns at {turning:.1f} rad/s, limit {limits.turning:g}"
        for axis, value, (low, high) in zip("xyz", vehicle.position, (limits.x, limits.y, limits.z), strict=True):
            if not low <= value <= high:
                return f"vehicle outside its fence: {axis} = {value:.2f} m, allowed {low:g} to {high:g}"
        return ""
