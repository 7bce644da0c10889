"""PX4's parameter store: the 887 parameters that a v1.17 SITL quadrotor uses, with PX4's rules for setting them."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vehicle.px4.sim.rows import control
from vehicle.quadrotor import airframe_row
from vehicle.quadrotor.airframe import Airframe

DEFAULTS = Path(__file__).parent / "params.json"
UINT32, INT32, REAL32 = 5, 6, 9  # MAV_PARAM_TYPE
HASH_NAME, NO_INDEX = "_HASH_CHECK", 65535

_RATE_GAINS = {"P": airframe_row.RATE_P, "I": airframe_row.RATE_I, "D": airframe_row.RATE_D, "K": airframe_row.RATE_K}
# Index of the rate loop's parameters in a params row.
RATE_LOOP = {
    f"MC_{axis}RATE_{gain}": index + i
    for gain, index in _RATE_GAINS.items()
    for i, axis in enumerate(("ROLL", "PITCH", "YAW"))
} | {
    "MC_RR_INT_LIM": airframe_row.RATE_LIMIT_I,
    "MC_PR_INT_LIM": airframe_row.RATE_LIMIT_I + 1,
    "MC_YR_INT_LIM": airframe_row.RATE_LIMIT_I + 2,
    "IMU_GYRO_CUTOFF": airframe_row.GYRO_CUTOFF,
    "IMU_DGYRO_CUTOFF": airframe_row.DGYRO_CUTOFF,
    "MC_YAW_TQ_CUTOFF": airframe_row.YAW_TORQUE_CUTOFF,
}


class Parameters:
    """Values by name. REAL32 are Python floats rounded to single precision, INT32 are ints."""

    def __init__(self, overrides: Mapping[str, float] | None = None) -> None:
        """PX4's defaults with `overrides` set before boot. Raises ValueError for a name PX4 does not have."""
        self.values: dict[str, float | int] = json.loads(DEFAULTS.read_text())
        self.names = sorted(self.values)
        self._index = {name: i for i, name in enumerate(self.names)}
        self.is_int = {name: isinstance(value, int) for name, value in self.values.items()}
        for name, value in (overrides or {}).items():
            if name not in self.values:
                raise ValueError(f"boot parameter {name!r} is not one of PX4's {len(self.names)}; check its spelling")
            self.values[name] = int(value) if self.is_int[name] else _single(float(value))

    def __getitem__(self, name: str) -> float | int:
        return self.values[name]

    def __len__(self) -> int:
        return len(self.names)

    def index(self, name: str) -> int:
        """Place of a parameter in PARAM_REQUEST_LIST's order."""
        return self._index[name]

    def kind(self, name: str) -> int:
        """MAV_PARAM_TYPE of a parameter."""
        return INT32 if self.is_int[name] else REAL32

    def wire(self, name: str) -> bytes:
        """The four bytes of PARAM_VALUE.param_value: an INT32 lies bytewise in the float field."""
        return struct.pack("<i" if self.is_int[name] else "<f", self.values[name])

    def set_wire(self, name: str, kind: int, four: bytes) -> bool | None:
        """PARAM_SET: True if the value changed, False if it had that value already, None if PX4 does not answer.

        A name or type that does not match is ignored without an answer; ranges are not checked.
        """
        if name not in self.values or kind != self.kind(name):
            return None
        (value,) = struct.unpack("<i" if self.is_int[name] else "<f", four)
        changed = value != self.values[name]
        self.values[name] = value
        return changed

    def hash(self) -> int:
        """_HASH_CHECK: CRC-32 over names and values in order, without PX4's list of volatile parameters."""
        crc = 0
        for name in self.names:
            for part in (name.encode(), self.wire(name)):
                crc = zlib.crc32(part, crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
        return crc


def _single(value: float) -> float:
    return struct.unpack("<f", struct.pack("<f", value))[0]


def airframe_overrides(frame: Airframe) -> dict[str, float]:
    """PX4 parameters that describe an airframe, so that the list a client reads matches what flies."""
    row = frame.params_row()
    values = {name: float(row[index]) for name, index in RATE_LOOP.items()}
    values |= {
        "SIH_MASS": frame.body.mass,
        "SIH_IXX": frame.body.inertia[0],
        "SIH_IYY": frame.body.inertia[1],
        "SIH_IZZ": frame.body.inertia[2],
        "SIH_KDV": sum(frame.body.drag) / 3,
        "SIH_KDW": frame.body.angular_damping,
        "SIH_L_ROLL": frame.motors.arm_y,
        "SIH_L_PITCH": frame.motors.arm_x,
        "SIH_T_MAX": float(row[airframe_row.MOTOR_THRUST]),
        "SIH_Q_MAX": float(row[airframe_row.MOTOR_THRUST] * row[airframe_row.YAW_TORQUE]),
        "SIH_T_TAU": frame.motors.lag,
        "MPC_THR_HOVER": frame.hover_thrust,
    }
    return values


def apply(parameters: Parameters, params: np.ndarray, row: np.ndarray) -> None:
    """Write the rate loop's gains into a params row and the cascade's gains into a control row."""
    for name, index in RATE_LOOP.items():
        params[index] = parameters[name]
    for i, name in enumerate(control.PARAMETERS):
        row[control.GAINS + i] = parameters[name]
