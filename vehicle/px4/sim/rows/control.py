"""Indices of the control row (LENGTH,): set-points, limits, states and results of the cascade, then PX4's gains.

World ENU, body FLU, SI units. A set-point that is not given is NaN.
"""

from __future__ import annotations

# Values of MODE.
OFF, RATES, ATTITUDE, POSITION = 0.0, 1.0, 2.0, 3.0

# Set-points:
MODE = 0
RATE_SP = 1  # 3, rad/s, body
THRUST_SP = 4  # 0..1
ATT_SP = 5  # 4, world from body
POS_SP, VEL_SP, ACC_SP = 9, 12, 15  # 3 each, m, m/s, m/s^2, world
YAW_SP, YAW_RATE_SP = 18, 19  # rad, rad/s
SMOOTH = 20  # 1: AUTO, the velocity set-point is slewed
MAX_XY, MAX_UP, MAX_DOWN, MAX_TILT = 21, 22, 23, 24  # m/s, rad
RAMP = 25  # m/s, ceiling of the climb rate while taking off; inf otherwise
LANDED = 26  # 1: integrators stay empty unless a take-off ramp runs
# States:
VEL_INT, VEL_SMOOTH, ACC_LP, VEL_LAST = 27, 30, 33, 36  # 3 each
YAW_SMOOTH = 39
# Results:
OUT_RATE, OUT_THRUST, OUT_ATT, ATT_THRUST = 40, 43, 44, 48
# PX4's parameters, one index each:
GAINS = 49
PARAMETERS = (
    "MPC_XY_P",
    "MPC_Z_P",
    "MPC_XY_VEL_P_ACC",
    "MPC_XY_VEL_I_ACC",
    "MPC_XY_VEL_D_ACC",
    "MPC_Z_VEL_P_ACC",
    "MPC_Z_VEL_I_ACC",
    "MPC_Z_VEL_D_ACC",
    "MPC_THR_HOVER",
    "MPC_THR_MIN",
    "MPC_THR_MAX",
    "MC_ROLL_P",
    "MC_PITCH_P",
    "MC_YAW_P",
    "MC_YAW_WEIGHT",
    "MC_ROLLRATE_MAX",
    "MC_PITCHRATE_MAX",
    "MC_YAWRATE_MAX",
    "MPC_ACC_HOR",
    "MPC_ACC_UP_MAX",
    "MPC_ACC_DOWN_MAX",
    "MPC_YAWRAUTO_MAX",
    "MPC_VELD_LP",
)
LENGTH = GAINS + len(PARAMETERS)
XY_P, Z_P = GAINS, GAINS + 1
XY_VEL_P, XY_VEL_I, XY_VEL_D = GAINS + 2, GAINS + 3, GAINS + 4
Z_VEL_P, Z_VEL_I, Z_VEL_D = GAINS + 5, GAINS + 6, GAINS + 7
THR_HOVER, THR_MIN, THR_MAX = GAINS + 8, GAINS + 9, GAINS + 10
ROLL_P, PITCH_P, YAW_P, YAW_WEIGHT = GAINS + 11, GAINS + 12, GAINS + 13, GAINS + 14
RATE_MAX = GAINS + 15  # 3: roll, pitch, yaw, deg/s
ACC_HOR, ACC_UP, ACC_DOWN = GAINS + 18, GAINS + 19, GAINS + 20
YAW_AUTO, VELD_LP = GAINS + 21, GAINS + 22  # deg/s, Hz
