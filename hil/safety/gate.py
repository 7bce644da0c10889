"""The gates: the last look at a command before the vehicle's wire, and before the car's. Pure: no clock, no I/O.

A command outside the limits of rate or thrust is clipped and marked. What cannot be clipped (a number that is not
finite, a vehicle too fast, tumbling, outside its fence, of unknown whereabouts, or blind for seconds) trips the gate:
it latches, nothing more is sent, and the autopilot's own failsafe acts on the silence. The car's gate does the same,
and the car's own 500 ms watchdog stops it.
"""

from __future__ import annotations

import math

from pydantic import BaseModel, ConfigDict, Field, field_validator

from hil.contract.messages import Action, CarCommand, CarFeedback, Sent, VehicleState

Range = tuple[float, float]


class GateLimits(BaseModel):
    """Limits of the gate; SI units, world ENU. Defaults suit the paper's quadrotor and the scenarios' workspace."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    rate: float = Field(default=4.0, gt=0, le=20, description="each body rate, rad/s (paper: omega_lim 4.0)")
    thrust: Range = Field(default=(2.0, 18.0), description="mass-normalised collective thrust, m/s^2")
    speed: float = Field(default=8.0, gt=0, le=30, description="of the vehicle, m/s")
    turning: float = Field(default=12.0, gt=0, le=60, description="of the vehicle about any axis, rad/s")
    x: Range = (-25.0, 25.0)
    y: Range = (-25.0, 25.0)
    z: Range = (0.3, 9.0)
    command_age_ms: float = Field(default=50.0, gt=0, le=1000, description="an older command is not sent")
    odometry_age_ms: float = Field(default=200.0, gt=0, le=2000, description="older odometry trips")
    blind: float = Field(default=3.0, gt=0, le=60, description="s without seeing the board that trip")

    @field_validator("thrust", "x", "y", "z")
    @classmethod
    def _upwards(cls, value: Range) -> Range:
        if not value[0] < value[1]:
            raise ValueError(f"{list(value)} must be [lower, upper]")
        return value

    @field_validator("thrust")
    @classmethod
    def _pushes(cls, value: Range) -> Range:
        if value[0] < 0:
            raise ValueError(f"{list(value)}: rotors push, they do not pull; the lower limit is 0 or more")
        return value


class Gate:
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


class CarGateLimits(BaseModel):
    """Limits of the car's gate; SI units. Defaults are the Scout Mini's own limits and a margin on what is measured."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    speed: float = Field(default=3.0, gt=0, le=3.0, description="that may be asked of the car, m/s")
    turn_rate: float = Field(default=2.5235, gt=0, le=2.5235, description="the same, rad/s")
    measured_speed: float = Field(default=3.5, gt=0, le=5, description="of the wheels, m/s; more trips")
    measured_turn_rate: float = Field(default=4.0, gt=0, le=10, description="of the wheels, rad/s; more trips")
    command_age_ms: float = Field(default=100.0, gt=0, le=400, description="an older command is not sent")
    feedback_age_ms: float = Field(default=500.0, gt=0, le=2000, description="an older word of the car trips")


class CarGate:
    """The car's gate. `check` returns what may be sent, or None if nothing may; a trip latches."""

    def __init__(self, limits: CarGateLimits) -> None:
        self._limits = limits
        self.tripped = ""
        self.refused = 0

    def check(self, now_ns: int, command: CarCommand, car: CarFeedback | None) -> CarCommand | None:
        """`command` within the limits; `car` is what it said last, None before its first word."""
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
            return ""  # it has not spoken yet, and the driver sends nothing before it does
        if now_ns - car.stamp_ns > limits.feedback_age_ms * 1e6:
            return f"the car has said nothing for {limits.feedback_age_ms:g} ms"
        if abs(car.speed) > limits.measured_speed:
            return f"car at {car.speed:.1f} m/s, limit {limits.measured_speed:g}"
        if abs(car.turn_rate) > limits.measured_turn_rate:
            return f"car turns at {car.turn_rate:.1f} rad/s, limit {limits.measured_turn_rate:g}"
        return ""
