"""Airframes: mass, motors, rate control, contact disc and camera mount of a quadrotor, read from TOML.

Body frame FLU with its origin in the centre of mass. Motors are numbered as PX4's quad X: 0 front right, 1 rear left,
2 front left, 3 rear right; 0 and 1 turn counter-clockwise seen from above.
"""

from __future__ import annotations

import difflib
import math
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from kernel.toml_errors import read_toml, validate
from vehicle.quadrotor import airframe_row

AIRFRAME_DIR = Path(__file__).parent / "airframes"
GRAVITY = 9.80665

_Vec3 = tuple[float, float, float]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Body(_Section):
    """Rigid body."""

    mass: float = Field(gt=0, description="kg")
    inertia: _Vec3 = Field(description="principal moments about body x, y, z, kg m^2")
    drag: _Vec3 = Field(default=(0.0, 0.0, 0.0), description="linear drag along body x, y, z, N/(m/s)")
    angular_damping: float = Field(default=0.0, ge=0, description="Nm/(rad/s)")

    @model_validator(mode="after")
    def _physical(self) -> Body:
        ix, iy, iz = sorted(self.inertia)
        if ix <= 0 or iz > ix + iy:
            raise ValueError("inertia must be positive and the largest moment no more than the sum of the other two")
        if min(self.drag) < 0:
            raise ValueError("drag must not be negative")
        return self


class Motors(_Section):
    """Four equal motors in X."""

    thrust_to_weight: float = Field(gt=1, le=20, description="all four at full command, over weight")
    lag: float = Field(gt=0.001, le=0.5, description="first-order lag of thrust, s")
    arm_x: float = Field(gt=0, le=2, description="m")
    arm_y: float = Field(gt=0, le=2, description="m")
    yaw_torque: float = Field(gt=0, le=0.2, description="reaction torque over thrust, m")
    mixer_roll_pitch: float = Field(default=math.sqrt(0.5), gt=0, le=2)
    mixer_yaw: float = Field(default=1.0, gt=0, le=2)


class RateControl(_Section):
    """PX4's body rate loop: MC_{ROLL,PITCH,YAW}RATE_*, MC_*R_INT_LIM, IMU_*_CUTOFF, MC_YAW_TQ_CUTOFF."""

    p: _Vec3
    i: _Vec3
    d: _Vec3
    k: _Vec3 = (1.0, 1.0, 1.0)
    integral_limit: _Vec3 = (0.3, 0.3, 0.3)
    gyro_cutoff_hz: float = Field(default=40.0, gt=0, le=1000)
    dgyro_cutoff_hz: float = Field(default=20.0, gt=0, le=1000)
    yaw_torque_cutoff_hz: float = Field(default=2.0, ge=0, le=100, description="0 switches the filter off")


class CameraMount(_Section):
    """Mount of the camera."""

    offset: _Vec3 = Field(default=(0.08, 0.0, 0.0), description="from the centre of mass, body FLU, m")
    tilt_deg: float = Field(default=15.0, ge=-90, le=90, description="below the body's x axis")


class ContactGeometry(_Section):
    """The contact disc: what meets the board."""

    magnet_below: float = Field(gt=0, le=0.5, description="face of the magnet under the centre of mass, m")
    footprint_radius: float = Field(gt=0, le=1, description="disc that stands for body and rotors, m")


class CommandLimits(_Section):
    """What may be asked of the vehicle (paper App. "Experimental Setup"), and how soon its body rate follows."""

    thrust: tuple[float, float] = Field(description="mass-normalised collective thrust, least and most, m/s^2")
    body_rate: float = Field(gt=0, le=20, description="most about each body axis, rad/s")
    rate_lag: float = Field(gt=0.001, le=0.5, description="first-order lag of the body rate behind its set-point, s")

    @model_validator(mode="after")
    def _carries(self) -> CommandLimits:
        low, high = self.thrust
        if not 0.0 <= low < GRAVITY < high:
            raise ValueError(f"thrust is [{low}, {high}]; it must hold gravity ({GRAVITY} m/s^2) between its limits")
        return self


class Airframe(_Section):
    """One airframe file. See `params_row` for kernels."""

    name: str
    title: str
    body: Body
    motors: Motors
    rate_control: RateControl
    command: CommandLimits
    camera: CameraMount = CameraMount()
    contact: ContactGeometry

    @model_validator(mode="after")
    def _strong_enough(self) -> Airframe:
        most = self.motors.thrust_to_weight * GRAVITY
        if self.command.thrust[1] > most:
            asked = self.command.thrust[1]
            raise ValueError(f"command.thrust reaches {asked} m/s^2; the motors give {most:.2f} at most")
        return self

    @property
    def hover_thrust(self) -> float:
        """Normalised collective command (0..1) that carries the nominal vehicle; the thrust map is linear."""
        return 1.0 / self.motors.thrust_to_weight

    def limits_row(self) -> np.ndarray:
        """The (limits_row.DIM,) float64 row of what may be asked, for kernels."""
        return np.array([*self.command.thrust, self.command.body_rate])

    def params_row(self) -> np.ndarray:
        """The airframe row for kernels (vehicle.quadrotor.airframe_row)."""
        row = np.zeros(airframe_row.DIM)
        body, motors, rates = self.body, self.motors, self.rate_control
        row[airframe_row.MASS], row[airframe_row.ANGULAR_DAMPING] = body.mass, body.angular_damping
        row[airframe_row.INERTIA : airframe_row.INERTIA + 3], row[airframe_row.DRAG : airframe_row.DRAG + 3] = (
            body.inertia,
            body.drag,
        )
        row[airframe_row.MOTOR_LAG] = motors.lag
        row[airframe_row.MOTOR_THRUST] = 0.25 * motors.thrust_to_weight * body.mass * GRAVITY
        row[airframe_row.ARM_X], row[airframe_row.ARM_Y], row[airframe_row.YAW_TORQUE] = (
            motors.arm_x,
            motors.arm_y,
            motors.yaw_torque,
        )
        row[airframe_row.MIXER_ROLL_PITCH], row[airframe_row.MIXER_YAW] = motors.mixer_roll_pitch, motors.mixer_yaw
        row[airframe_row.HOVER_THRUST] = self.hover_thrust
        for index, gains in (
            (airframe_row.RATE_P, rates.p),
            (airframe_row.RATE_I, rates.i),
            (airframe_row.RATE_D, rates.d),
            (airframe_row.RATE_K, rates.k),
        ):
            row[index : index + 3] = gains
        row[airframe_row.RATE_LIMIT_I : airframe_row.RATE_LIMIT_I + 3] = rates.integral_limit
        row[airframe_row.GYRO_CUTOFF], row[airframe_row.DGYRO_CUTOFF] = rates.gyro_cutoff_hz, rates.dgyro_cutoff_hz
        row[airframe_row.YAW_TORQUE_CUTOFF] = rates.yaw_torque_cutoff_hz
        row[airframe_row.MAGNET_Z], row[airframe_row.FOOTPRINT_RADIUS] = (
            self.contact.magnet_below,
            self.contact.footprint_radius,
        )
        return row


def list_airframes() -> list[str]:
    """Names of the airframes that come with the project."""
    return sorted(path.stem for path in AIRFRAME_DIR.glob("*.toml"))


def load_airframe(name: str | Path) -> Airframe:
    """The airframe of that name, or of the TOML file at that path. Raises ConfigError naming file, key and fault,
    ValueError for a name that there is no airframe of."""
    path = Path(name)
    if path.suffix != ".toml":
        path = AIRFRAME_DIR / f"{name}.toml"
        if not path.exists():
            near = difflib.get_close_matches(str(name), list_airframes(), 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            known = ", ".join(list_airframes())
            raise ValueError(f"no airframe {str(name)!r}: known are {known}{hint} (or give a path to a .toml)")
    return validate({"name": path.stem, **read_toml(path)}, Airframe, str(path))
