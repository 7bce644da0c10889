"""Reflection symmetry: observation and action reflected in the vertical plane through the vehicle's yaw.

The task is symmetric: the dynamics, the camera (which sits in that plane) and the distribution of board motions are
unchanged by the reflection. So the reflected observation asks for the reflected action.
"""

from __future__ import annotations

import numpy as np

from policies.task.observation import HISTORY

_AXES = (1.0, -1.0, 1.0)  # of a vector: forward, left, up
_ENTRY = (*_AXES, *_AXES, 1.0, -1.0, -1.0, 1.0)
_ROTATION = tuple(np.outer(_AXES, _AXES).ravel().tolist())
ACTION_SIGNS = (-1.0, 1.0, -1.0, 1.0)  # body rates are an axial vector
OBSERVATION_SIGNS = (*_ENTRY * HISTORY, *_AXES, *_ROTATION, 1.0, *ACTION_SIGNS, 1.0, 1.0, 1.0)
"""Multiplied with an observation (policies/task/observation.py): the observation of the reflected flight."""
