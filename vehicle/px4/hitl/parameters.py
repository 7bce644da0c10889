"""PX4's parameters that make a firmware fly one of our airframes, set before it boots."""

from __future__ import annotations

from vehicle.px4.hitl.suite import GPS_DELAY_MS
from vehicle.px4.sim.params import RATE_LOOP
from vehicle.quadrotor.airframe import Airframe

# Motors as PX4 numbers those of a quad X: front right, rear left (both turn counter-clockwise), front left, rear right.
_CORNERS = ((1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1))  # forward, right, sense of rotation

EXTERNAL_POSE = {"EKF2_EV_CTRL": 11, "EKF2_GPS_CTRL": 0, "EKF2_HGT_REF": 3, "SYS_HAS_GPS": 0}
"""What lets PX4 fly on the poses of motion capture alone."""


def firmware_parameters(frame: Airframe, external_pose: bool = False) -> dict[str, float]:
    """Name -> value: geometry and thrust of the motors, rate gains and filters, hover thrust, sensors as simulated."""
    row = frame.params_row()
    values: dict[str, float] = {"CA_AIRFRAME": 0, "CA_ROTOR_COUNT": 4}
    for i, (forward, right, turn) in enumerate(_CORNERS):
        values[f"CA_ROTOR{i}_PX"] = forward * frame.motors.arm_x
        values[f"CA_ROTOR{i}_PY"] = right * frame.motors.arm_y
        values[f"CA_ROTOR{i}_KM"] = turn * frame.motors.yaw_torque
        values[f"PWM_MAIN_FUNC{i + 1}"] = 101 + i
    values |= {name: float(row[index]) for name, index in RATE_LOOP.items()}
    values |= {"MPC_THR_HOVER": frame.hover_thrust, "IMU_INTEG_RATE": 250, "THR_MDL_FAC": 0.0}
    values |= {"EKF2_GPS_DELAY": GPS_DELAY_MS}  # a SITL's is 10
    values |= {"SDLOG_MODE": 0, "SYS_HAS_MAG": 1, "EKF2_MULTI_IMU": 1, "SENS_IMU_MODE": 1}
    return values | (EXTERNAL_POSE if external_pose else {})
