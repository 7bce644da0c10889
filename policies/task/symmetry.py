"""Left and right: what a policy sees and does, reflected in the vertical plane through the drone's yaw.

Nothing in the task tells left from right: not the dynamics, not the camera, which sits in that plane, not the motions.
So whoever sees the mirror image should do the mirror image.
"""

from __future__ import annotations

import numpy as np

from policies.task.observation import HISTORY

_AXES = (1.0, -1.0, 1.0)  # of a vector: forward, left, up
_ENTRY = (*_AXES, *_AXES, 1.0, -1.0, -1.0, 1.0)
_ROTATION = tuple(np.outer(_AXES, _AXES).ravel().tolist())
ACTION_SIGNS = (-1.0, 1.0, -1.0, 1.0)  # body rates are an axial vector
OBSERVATION_SIGNS = (*_ENTRY * HISTORY, *_AXES, *_ROTATION, 1.0, *ACTION_SIGNS, 1.0, 1.0, 1.0)
"""Times the observation (policies/task/observation.py), it is what a drone sees that flies the mirror image."""
