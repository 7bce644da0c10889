"""Airframes: what a quadrotor weighs, pushes and carries, read from TOML, and its (NP,) row for kernels.

Body frame FLU with its origin in the centre of mass. Motors are numbered as PX4's quad X: 0 front right, 1 rear left,
2 front left, 3 rear right; 0 and 1 turn counter-clockwise seen from above.
"""

from __future__ import annotations

import difflib
import math
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from kernel.random import uniform
from kernel.toml_errors import read_toml, validate

AIRFRAME_DIR = Path(__file__).parent / "airframes"
GRAVITY = 9.80665

# Indices of a params row. Names of three elements are slices X, X + 1, X + 2 for roll, pitch, yaw (body x, y, z).
MASS = 0  # kg
INERTIA = 1  # 3, kg m^2
DRAG = 4  # 3, N/(m/s), along the body's axes
ANGULAR_DAMPING = 7  # Nm/(rad/s)
MOTOR_LAG = 8  # s
MOTOR_THRUST = 9  # N, one motor at command 1
ARM_X, ARM_Y = 10, 11  # m, motors stand at (+-ARM_X, +-ARM_Y)
YAW_TORQUE = 12  # m, reaction torque over thrust of a motor
MIXER_ROLL_PITCH, MIXER_YAW = 13, 14  # motor command per unit of torque set-point
HOVER_THRUST = 15  # 0..1, what the controller believes: randomising the vehicle does not change it
RATE_P, RATE_I, RATE_D, RATE_K, RATE_LIMIT_I = 16, 19, 22, 25, 28  # 3 each
GYRO_CUTOFF, DGYRO_CUTOFF, YAW_TORQUE_CUTOFF = 31, 32, 33  # Hz
MAGNET_Z = 34  # m, face of the magnet below the centre of mass (positive down)
FOOTPRINT_RADIUS = 35  # m
NP = 36

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
    """Where the camera sits."""

    offset: _Vec3 = Field(default=(0.08, 0.0, 0.0), description="from the centre of mass, body FLU, m")
    tilt_deg: float = Field(default=15.0, ge=-90, le=90, description="below the body's x axis")


class ContactGeometry(_Section):
    """What touches the board."""

    magnet_below: float = Field(
        default=0.04, gt=0, le=0.5, description="face of the magnet under the centre of mass, m"
    )
    footprint_radius: float = Field(default=0.13, gt=0, le=1, description="disc that stands for body and rotors, m")


class Airframe(_Section):
    """One airframe file. See `params_row` for kernels."""

    name: str
    title: str
    body: Body
    motors: Motors
    rate_control: RateControl
    camera: CameraMount = CameraMount()
    contact: ContactGeometry = ContactGeometry()

    @property
    def hover_thrust(self) -> float:
        """Normalised collective command (0..1) that carries the nominal vehicle; the thrust map is linear."""
        return 1.0 / self.motors.thrust_to_weight

    def params_row(self) -> np.ndarray:
        """The (NP,) float64 row that kernels take, indices as named in this module."""
        row = np.zeros(NP)
        body, motors, rates = self.body, self.motors, self.rate_control
        row[MASS], row[ANGULAR_DAMPING] = body.mass, body.angular_damping
        row[INERTIA : INERTIA + 3], row[DRAG : DRAG + 3] = body.inertia, body.drag
        row[MOTOR_LAG] = motors.lag
        row[MOTOR_THRUST] = 0.25 * motors.thrust_to_weight * body.mass * GRAVITY
        row[ARM_X], row[ARM_Y], row[YAW_TORQUE] = motors.arm_x, motors.arm_y, motors.yaw_torque
        row[MIXER_ROLL_PITCH], row[MIXER_YAW] = motors.mixer_roll_pitch, motors.mixer_yaw
        row[HOVER_THRUST] = self.hover_thrust
        for index, gains in ((RATE_P, rates.p), (RATE_I, rates.i), (RATE_D, rates.d), (RATE_K, rates.k)):
            row[index : index + 3] = gains
        row[RATE_LIMIT_I : RATE_LIMIT_I + 3] = rates.integral_limit
        row[GYRO_CUTOFF], row[DGYRO_CUTOFF] = rates.gyro_cutoff_hz, rates.dgyro_cutoff_hz
        row[YAW_TORQUE_CUTOFF] = rates.yaw_torque_cutoff_hz
        row[MAGNET_Z], row[FOOTPRINT_RADIUS] = self.contact.magnet_below, self.contact.footprint_radius
        return row

    def randomised(
        self, stream: np.ndarray, mass: float = 0.30, inertia: float = 0.10, twr: float = 0.15
    ) -> np.ndarray:
        """A params row with mass, inertia and thrust-to-weight drawn independently (paper App. "Domain Randomization").

        The arguments are half-widths relative to nominal. Full thrust is drawn thrust-to-weight x drawn weight, so what
        a command yields per kilogram scales with thrust-to-weight alone; HOVER_THRUST stays nominal, because the
        controller does not know. Drawing order: mass, one factor for the whole inertia, thrust-to-weight.
        """
        return randomise_row(self.params_row(), stream, mass, inertia, twr)


def randomise_row(nominal: np.ndarray, stream: np.ndarray, mass: float, inertia: float, twr: float) -> np.ndarray:
    """`Airframe.randomised` for a params row (NP,); returns a new row."""
    row = nominal.copy()
    mass_factor = uniform(stream, 1.0 - mass, 1.0 + mass)
    inertia_factor = uniform(stream, 1.0 - inertia, 1.0 + inertia)
    twr_factor = uniform(stream, 1.0 - twr, 1.0 + twr)
    row[MASS] *= mass_factor
    row[INERTIA : INERTIA + 3] *= inertia_factor
    row[MOTOR_THRUST] *= mass_factor * twr_factor
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
