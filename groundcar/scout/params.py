"""Parameters of the car, read from `scout_mini.toml`, which gives the source of every number."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from kernel.toml_errors import load_toml

PARAMS_PATH = Path(__file__).parent / "scout_mini.toml"

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Part = Annotated[float, Field(ge=0, lt=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Geometry(_Table):
    """Metres."""

    length: Positive
    width: Positive
    height: Positive
    wheelbase: Positive
    track: Positive
    wheel_radius: Positive
    pulses_per_metre: Positive


class Limits(_Table):
    """Limits of commands: m/s, rad/s."""

    speed: Annotated[float, Field(gt=0, le=3.0)]
    turn_rate: Annotated[float, Field(gt=0, le=2.5235)]


class Protocol(_Table):
    """Seconds."""

    command_period: Positive
    watchdog: Positive
    enable_period: Positive
    command_max_age: Positive
    silent_after: Positive

    @model_validator(mode="after")
    def _watchdog_can_act(self) -> Protocol:
        if self.command_max_age >= self.watchdog:
            raise ValueError("command_max_age must be below watchdog, or the driver would outlive the car's own stop")
        return self


class Response(_Table):
    """Response of the simulated car; SI units."""

    delay: NotNegative
    speed_frequency: Positive
    speed_damping: Positive
    acceleration: Positive
    stop_deceleration: Positive
    turn_lag: Positive
    turn_acceleration: Positive
    turn_gain: Positive
    speed_noise: NotNegative
    speed_noise_time: Positive
    turn_noise: NotNegative
    turn_noise_time: Positive


class Spread(_Table):
    """Half-widths of the uniform draws of a seed."""

    speed_frequency: Part
    speed_damping: Part
    speed_gain: Part
    turn_gain: Part
    turn_lag: Part
    veer: NotNegative
    battery: NotNegative


class Battery(_Table):
    """V, Ah, ohm, A, A/N, kg."""

    full: Positive
    start: Positive
    warning: Positive
    fault: Positive
    capacity: Positive
    resistance: NotNegative
    idle_current: NotNegative
    current_per_newton: NotNegative
    mass: Positive


class FollowerGains(_Table):
    """See groundcar.scout.follower."""

    along: NotNegative
    across: NotNegative
    heading: NotNegative
    lead: Annotated[float, Field(ge=0, le=1)]
    acceleration: Positive
    correction: NotNegative


class Imitation(_Table):
    """`response` and `damping` of groundcar.motion.board_motion that imitate this car: rad/s, 1."""

    response: Positive
    damping: Positive


class ScoutParams(_Table):
    """One car."""

    title: str
    geometry: Geometry
    limits: Limits
    protocol: Protocol
    response: Response
    spread: Spread
    battery: Battery
    follower: FollowerGains
    imitation: Imitation


def load_scout(path: Path = PARAMS_PATH) -> ScoutParams:
    """The car's parameters. Raises ConfigError that names the file and every faulty key."""
    return load_toml(path, ScoutParams)
