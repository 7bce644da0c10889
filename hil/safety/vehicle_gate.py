"""The vehicle's safety gate: the last check of a command before the vehicle's wire. Pure: no clock, no I/O.

A command outside the limits of rate or thrust is clipped and marked. What cannot be clipped trips the gate: a number
that is not finite; a stamp later than now; a vehicle that is too fast, tumbling, outside its fence, about to sink
through its floor, or without fresh odometry; odometry that moves faster than the vehicle can; a board that has not been
seen for seconds, or for a moment of the dive at it if it moves; by motion capture, a board that is not where the policy
believes it to be; a command that repeats to the last bit while the odometry changes. A trip latches: no command is sent
any more, the driver hands the vehicle back to its autopilot, and the autopilot's own failsafe acts on the missing
commands if that order is lost.
"""

from __future__ import annotations

import math
from dataclasses import replace

from hil.contract.messages import Action, Belief, BoardState, Quat, Sent, VehicleState
from hil.safety.approach import wrong_board
from hil.safety.descent import height_lost
from hil.safety.dive import SILENCE_NS, Lookout, diving
from hil.safety.limits import GateLimits
from kernel.stamps import later_than_now
from vehicle.quadrotor.airframe import CommandLimits

_JUMP_M, _JUMP_RAD = 0.5, 0.5  # what an estimator may correct at once, on top of motion within the limits
_UNIT_NORM = 0.05  # deviation of a quaternion's norm from 1
_REPEAT_NS = 200_000_000  # a policy of 10 Hz repeats each command for 100 ms
_AT_BOUND = 0.999  # share of a bound: a network's last layer comes near it only


class VehicleGate:
    """One vehicle's gate. `check` returns what may be sent, or None if nothing may."""

    def __init__(
        self, limits: GateLimits, asked: CommandLimits | None = None, camera_tilt: float | None = None
    ) -> None:
        """`asked`: within what policies ask, where that is less than `limits`. `camera_tilt`: see `Lookout`."""
        self._limits = limits
        self._lookout = Lookout(camera_tilt)
        self._rate = min(limits.rate, asked.body_rate) if asked else limits.rate
        self._thrust = asked.thrust if asked else limits.thrust
        self.tripped = ""
        self.refused = 0
        self._before: VehicleState | None = None  # the odometry of the check before
        self._repeated: tuple[Action, VehicleState, int] | None = None  # the first of equal commands, its odometry, ns

    @property
    def least_thrust(self) -> float:
        """The smallest thrust that passes unchanged, m/s^2."""
        return self._limits.thrust[0]

    @property
    def most_speed(self) -> float:
        """The speed beyond which the gate trips, m/s."""
        return self._limits.speed

    def check(
        self,
        now_ns: int,
        action: Action,
        vehicle: VehicleState | None,
        board: Belief | None = None,
        seen: tuple[VehicleState | None, BoardState | None] = (None, None),
    ) -> Sent | None:
        """`action` against the limits; `vehicle` is the newest odometry, `board` the newest belief, `seen` vehicle and
        board by motion capture, None before the first. A trip latches; `tripped` names its reason."""
        if self.tripped:
            return None
        self.tripped = (
            self._trip(now_ns, action, vehicle)
            or self._lookout.unseen(now_ns, vehicle, board)
            or wrong_board(now_ns, *seen, board)
        )
        if not self.tripped and vehicle is not None:
            limit_ns = SILENCE_NS if diving(now_ns, vehicle, board) else _REPEAT_NS
            self.tripped = self._repeats(now_ns, action, vehicle, limit_ns)
        if self.tripped:
            return None
        self._before = vehicle
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
        if later_than_now(vehicle.stamp_ns, now_ns):
            return f"odometry is stamped {(vehicle.stamp_ns - now_ns) * 1e-6:.1f} ms later than now"
        if later_than_now(action.exposure_ns, now_ns):
            return f"the command's picture is stamped {(action.exposure_ns - now_ns) * 1e-6:.1f} ms later than now"
        blind = (now_ns - action.exposure_ns) * 1e-9
        if blind > limits.blind:
            return f"board not seen for {blind:.1f} s, limit {limits.blind:g}"
        numbers = (*vehicle.position, *vehicle.velocity, *vehicle.orientation, *vehicle.body_rate)
        if not all(map(math.isfinite, numbers)):
            return "odometry is not finite"
        if abs(math.hypot(*vehicle.orientation) - 1.0) > _UNIT_NORM:
            return "odometry has no unit quaternion"
        speed = math.hypot(*vehicle.velocity)
        if speed > limits.speed:
            return f"vehicle at {speed:.1f} m/s, limit {limits.speed:g}"
        turning = math.hypot(*vehicle.body_rate)
        if turning > limits.turning:
            return f"vehicle turns at {turning:.1f} rad/s, limit {limits.turning:g}"
        jump = self._jump(vehicle)
        if jump:
            return jump
        for axis, value, (low, high) in zip("xyz", vehicle.position, (limits.x, limits.y, limits.z), strict=True):
            if not low <= value <= high:
                return f"vehicle outside its fence: {axis} = {value:.2f} m, allowed {low:g} to {high:g}"
        sinks, height = max(0.0, -vehicle.velocity[2]), vehicle.position[2] - limits.z[0]
        if height_lost(vehicle) > height:
            return f"vehicle sinks at {sinks:.1f} m/s, {height:.2f} m above the floor of its fence"
        return ""

    def _repeats(self, now_ns: int, action: Action, vehicle: VehicleState, limit_ns: int) -> str:
        """Why the command does not answer to the odometry; empty if it does, or if no number of it could."""
        first = self._repeated
        if first is None or _numbers(first[0]) != _numbers(action) or self._at_bounds(action):
            self._repeated = action, vehicle, now_ns
            return ""
        seconds = (now_ns - first[2]) * 1e-9
        if now_ns - first[2] < limit_ns or replace(vehicle, stamp_ns=first[1].stamp_ns) == first[1]:
            return ""
        return f"command has not changed for {seconds:.2f} s, and the odometry has"

    def _at_bounds(self, action: Action) -> bool:
        """Whether each number is at a bound or 0: such a command may repeat although it is computed anew."""
        low, high = self._thrust
        margin = (1.0 - _AT_BOUND) * (high - low)
        free = any(rate and abs(rate) < _AT_BOUND * self._rate for rate in action.body_rate)
        return not free and not low + margin < action.thrust < high - margin

    def _jump(self, vehicle: VehicleState) -> str:
        """Why `vehicle` cannot follow from the odometry before at the limits of speed and turning; empty if it can."""
        before = self._before
        if before is None:
            return ""
        elapsed = max(0, vehicle.stamp_ns - before.stamp_ns) * 1e-9
        moved = math.dist(vehicle.position, before.position)
        if moved > self._limits.speed * elapsed + _JUMP_M:
            return f"odometry jumped by {moved:.2f} m within {elapsed * 1e3:.0f} ms"
        turned = _angle_between(vehicle.orientation, before.orientation)
        if turned > self._limits.turning * elapsed + _JUMP_RAD:
            return f"odometry turned by {turned:.2f} rad within {elapsed * 1e3:.0f} ms"
        return ""


def _numbers(action: Action) -> tuple[float, ...]:
    return (*action.body_rate, action.thrust)


def _angle_between(a: Quat, b: Quat) -> float:
    """The angle of the rotation from unit quaternion `a` to `b`, rad, 0 to pi."""
    return 2.0 * math.acos(min(1.0, abs(sum(x * y for x, y in zip(a, b, strict=True)))))
