"""Limits of both safety gates, as a rig file sets them; SI units, world ENU."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, field_validator

Range = tuple[float, float]  # lower, upper


class GateLimits(BaseModel):
    """Limits of the vehicle's gate. Defaults suit the paper's quadrotor and the scenarios' workspace."""

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

    @property
    def reach(self) -> float:
        """The largest coordinate inside the fence, m."""
        return max(abs(end) for side in (self.x, self.y, self.z) for end in side)

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


class CarGateLimits(BaseModel):
    """Limits of the car's gate. Defaults are the Scout Mini's own limits and a margin on what is measured."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    speed: float = Field(default=3.0, gt=0, le=3.0, description="that may be asked of the car, m/s")
    turn_rate: float = Field(default=2.5235, gt=0, le=2.5235, description="the same, rad/s")
    measured_speed: float = Field(default=3.5, gt=0, le=5, description="of the wheels, m/s; more trips")
    measured_turn_rate: float = Field(default=4.0, gt=0, le=10, description="of the wheels, rad/s; more trips")
    command_age_ms: float = Field(default=100.0, gt=0, le=400, description="an older command is not sent")
    feedback_age_ms: float = Field(default=500.0, gt=0, le=2000, description="older feedback of the car trips")
