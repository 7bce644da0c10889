"""Gains and limits of the software Crazyflie's position and attitude control, by the cascade's names (PX4's).

Limits and the outer gains are the firmware's (platform_defaults_cf2.h: PID_POS_*, PID_VEL_*_MAX, PID_*_KP). The inner
ones are this model's own, tuned to come to rest at a set-point within about 2 s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

GAINS: Mapping[str, float] = {
    "MPC_XY_P": 2.0,
    "MPC_Z_P": 2.0,
    "MPC_XY_VEL_P_ACC": 3.5,
    "MPC_XY_VEL_I_ACC": 0.5,
    "MPC_XY_VEL_D_ACC": 0.1,
    "MPC_Z_VEL_P_ACC": 6.0,
    "MPC_Z_VEL_I_ACC": 3.0,
    "MPC_Z_VEL_D_ACC": 0.0,
    "MPC_THR_HOVER": 0.65,
    "MPC_THR_MIN": 0.3,
    "MPC_THR_MAX": 1.0,
    "MC_ROLL_P": 6.0,
    "MC_PITCH_P": 6.0,
    "MC_YAW_P": 3.0,
    "MC_YAW_WEIGHT": 0.4,
    "MC_ROLLRATE_MAX": 220.0,
    "MC_PITCHRATE_MAX": 220.0,
    "MC_YAWRATE_MAX": 200.0,
    "MPC_ACC_HOR": 3.0,
    "MPC_ACC_UP_MAX": 3.0,
    "MPC_ACC_DOWN_MAX": 3.0,
    "MPC_YAWRAUTO_MAX": 120.0,
    "MPC_VELD_LP": 5.0,
    "MAX_XY": 1.0,  # m/s
    "MAX_UP": 1.0,
    "MAX_DOWN": 1.0,
    "MAX_TILT": math.radians(20.0),
}
