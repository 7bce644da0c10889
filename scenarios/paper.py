"""The published tables as typed rows: `published("real.hard-i")`, `paper().reward.lambda_1`."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Strict

from kernel.toml_errors import ConfigError, load_toml, nearest

FILE = Path(__file__).with_name("paper.toml")

Number = Annotated[float, Strict()]
Pair = tuple[Number, Number]


class _Row(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RealRow(_Row):
    """One flight of the real-world table: m, m/s, degrees where named; impact_normal is negative into the board."""

    platform_speed: Pair
    inclination_deg: Number
    x: Number
    y: Number
    planar: Number
    normal_alignment_deg: Number
    impact_normal: Number
    impact_tangential: Number
    perception_desired_hz: Number
    perception_actual_hz: Number

    def within(self, tolerance: Tolerance) -> bool:
        """Whether this published flight is inside `tolerance`: three of the six rows are not."""
        angle_deg = tolerance.angle * 57.29577951308232
        return (
            self.planar <= tolerance.distance
            and self.impact_tangential <= tolerance.tangential_speed
            and self.normal_alignment_deg <= angle_deg
        )


class SimulatedRow(_Row):
    """One operating point of the evaluation table: means over successful perches; normal_error in rad."""

    speed: Number
    inclination_deg: Number
    success_percent: Number
    duration: Number
    position_error: Number
    normal_error: Number
    tangential_speed: Number


class Reward(_Row):
    """Weights of the reward (paper's table of reward hyperparameters)."""

    lambda_1: Number
    lambda_2: Number
    lambda_3: Number
    lambda_4: Number
    lambda_5: Number
    lambda_6: Number
    lambda_7: Number
    lambda_8: Number
    lambda_f: Number
    lambda_s: Number
    alpha: Number
    beta: Number
    gamma: Number
    tau: Number


class Noise(_Row):
    """The visual observation noise model's coefficients."""

    k1: Number
    k2: Number
    k3: Number
    k4: Number
    k5: Number
    sigma_xy: Number
    sigma_z: Number
    sigma_q_deg: Number
    sigma_b: Number
    sigma_br_deg: Number


class Initialisation(_Row):
    """Ranges from which training and evaluation start."""

    platform_speed: Pair
    inclination_deg: Pair
    altitude: Pair
    distance: Pair
    azimuth_deg: Pair
    roll_pitch: Pair
    velocity_xy: Pair
    velocity_z: Pair
    roll_pitch_rate: Pair
    yaw_rate: Pair


class Randomisation(_Row):
    """Domain randomisation: relative half-widths, but for the detector's rate range."""

    mass: Number
    inertia: Number
    thrust_to_weight: Number
    camera_tilt_deg: Number
    detector_hz: Pair


class Tolerance(_Row):
    """m, m/s, rad."""

    distance: Number
    tangential_speed: Number
    angle: Number


class Limits(_Row):
    """Commanded thrust (m/s^2) and body rate (rad/s); speed and body rate limits of the reward."""

    thrust_min: Number
    thrust_max: Number
    body_rate_command: Number
    speed: Number
    body_rate: Number


class Trajectory(_Row):
    """Parameters of the board's motions; `cosine` is Hard-I's minimum, maximum (m/s) and period (s)."""

    height: Number
    line_amplitude: Number
    racetrack_radius: Number
    racetrack_straight: Number
    figure8_scale: Number
    spline_control_points: int
    spline_radius: Pair
    turn_rate_limit: Number
    ou_tau: Number
    ou_sigma: Number
    cosine: tuple[Number, Number, Number]


class Training(_Row):
    """Sizes of the training run and of the observation."""

    environments: int
    control_hz: Number
    episode_steps: int
    history: int
    future: int


class Setup(_Row):
    """Quadrotor, camera and board of the vision experiments."""

    mass: Number
    thrust_to_weight: Number
    camera_width: int
    camera_height: int
    field_of_view_deg: Pair
    camera_tilt_deg: Number
    board_size: Number
    inference_time: Number


class Crazyflie(_Row):
    """The small quadrotor of the state-based experiment."""

    mass: Number
    thrust_to_weight: Number
    thrust_limit_fraction: Number
    inclination_deg: Number


class Paper(_Row):
    """Every published table."""

    real: dict[str, RealRow]
    state: dict[str, SimulatedRow]
    vision: dict[str, SimulatedRow]
    reward: Reward
    noise: Noise
    initialisation: Initialisation
    randomisation: Randomisation
    tolerance: Tolerance
    limits: Limits
    trajectory: Trajectory
    training: Training
    setup: Setup
    crazyflie: Crazyflie


@cache
def paper() -> Paper:
    """The tables, read once."""
    return load_toml(FILE, Paper)


def row_keys() -> list[str]:
    """Every key that `published` accepts."""
    tables = {"real": paper().real, "state": paper().state, "vision": paper().vision}
    return [f"{table}.{row}" for table, rows in tables.items() for row in rows]


def published(row_key: str) -> RealRow | SimulatedRow:
    """The published row called `row_key`, e.g. "real.hard-i" or "vision.t2". Raises ConfigError naming the nearest."""
    table, _, row = row_key.partition(".")
    if row_key not in row_keys():
        raise ConfigError(f'no published row "{row_key}"{nearest(row_key, row_keys())} Known: {", ".join(row_keys())}')
    return getattr(paper(), table)[row]
