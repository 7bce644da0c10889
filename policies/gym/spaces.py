"""The spaces of observation and action, and the name of each number in them."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box

from policies.task.observation import HISTORY, OBS_DIM
from vehicle.quadrotor import command_row

_ENTRY = (
    *("x", "y", "z"),
    *("normal_x", "normal_y", "normal_z"),
    *("velocity_x", "velocity_y"),
    *("turn_rate", "time"),
)
_TAIL = (
    *("velocity_x", "velocity_y", "velocity_z"),
    *(f"rotation_{row}{column}" for row in range(3) for column in range(3)),
    "rho",
    *("previous_roll_rate", "previous_pitch_rate", "previous_yaw_rate", "previous_thrust"),
    *("thrust_gain", "drag", "surface_sigma"),
)

OBSERVATION_NAMES: tuple[str, ...] = (*(f"board_{age}_{name}" for age in range(HISTORY) for name in _ENTRY), *_TAIL)
"""(OBS_DIM,) names in the order of policies/task/observation.py; board_0 is the oldest entry of the history."""

ACTION_NAMES: tuple[str, ...] = ("roll_rate", "pitch_rate", "yaw_rate", "thrust")
"""(4,) names; each number in [-1, 1] is scaled by the airframe's limits of rate (rad/s, FLU) and thrust (m/s^2)."""


def observation_space() -> Box:
    """(OBS_DIM,) float32. Unbounded: positions and speeds have no limit of their own."""
    return Box(-np.inf, np.inf, (OBS_DIM,), np.float32)


def action_space() -> Box:
    """(4,) float32 in [-1, 1]."""
    return Box(-1.0, 1.0, (command_row.DIM,), np.float32)
