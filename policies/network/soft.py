"""The last 0.15 s: thrust that brakes a drone which would hit the board harder than it need.

By then the body's z axis is on the board's normal, so that thrust alone decides how fast they meet. A network that has
learnt from how flights end keeps some speed in hand, for who touches late slides down the slope meanwhile. Where the
surface is well known and the drone hardly slides, that is not needed, and what is too fast is braked away. Nothing is
ever taken off the thrust.

Part of a `soft` network and its file; the planner has its own law for thrust (`touch.py`).
"""

from __future__ import annotations

import torch
from torch import Tensor

from policies.guidance.alignment import BESIDE, SLOWEST
from policies.network.touch import BELOW, RADIUS, approach, seen_poorly
from policies.task import tail_row
from policies.task.observation import THRUST_MAX, THRUST_MIN
from vehicle.quadrotor.airframe import GRAVITY

WITHIN = 0.15  # s to contact, from where on
FACING = 0.8  # cosine between body z and normal, at least
LAG = 0.03  # s that the thrust asked before still acts
TILT = 0.1  # rad off the normal, at contact
MARGIN = 0.01  # m that the surface is taken to be farther than believed: who brakes too early hovers, and slides
SHORTEST = 0.01  # m in which it is at most to be braked away
SLIDING = 0.15, 0.3  # m/s along the board at contact: up to where it brakes for all, and from where on not at all
_HALF = 0.5 * (THRUST_MAX - THRUST_MIN)


def softened_action(newest: Tensor, tail: Tensor, action: Tensor, into: Tensor) -> Tensor:
    """Raise the thrust of `action` (B, 4) as far as a contact with `into` (1,) m/s asks for.

    `newest` (B, 10) history entry and `tail` (B, 20), both in the yaw frame. Under thrust f, of which `lift` acts along
    the normal, and the pull along it, speed^2 falls by twice (lift * f + pull) on every metre.
    """
    n, z, velocity, height, beside, closing, cosine = approach(newest, tail)
    height, lift = height - BELOW - TILT * RADIUS, 0.5 * (1.0 + cosine)
    gain, drag = tail[:, tail_row.GAIN : tail_row.GAIN + 1], tail[:, tail_row.DRAG : tail_row.DRAG + 1]
    given = gain * _thrust(tail[:, tail_row.ACTION + 3 : tail_row.ACTION + 4])
    asked = action[:, 3:4].clamp(-1.0, 1.0)
    free = (
        tail.new_tensor([[0.0, 0.0, -GRAVITY]]) - drag * tail[:, tail_row.V : tail_row.V + 3]
    )  # acceleration without thrust
    pull, way, lagging = (free * n).sum(1, keepdim=True), height + MARGIN, LAG * closing
    work = 0.5 * (closing * closing - into * into) - pull * way - lift * given * lagging
    needed = work / (lift * (way - lagging).clamp(min=SHORTEST))
    raised = ((needed / gain.clamp(min=0.3) - THRUST_MIN) / _HALF - 1.0).clamp(-1.0, 1.0)
    left = height / closing.clamp(min=SLOWEST)
    sliding = velocity + (gain * _thrust(asked) * z + free) * left.clamp(min=0.0, max=WITHIN)
    sliding = (sliding - (sliding * n).sum(1, keepdim=True) * n).norm(dim=1, keepdim=True)
    share = ((SLIDING[1] - sliding) / (SLIDING[1] - SLIDING[0])).clamp(0.0, 1.0) * (1.0 - seen_poorly(tail))
    softened = asked + share * (raised - asked).clamp(min=0.0)
    near = (height > 0.0) & (left <= WITHIN) & (closing > into) & (cosine >= FACING) & (beside <= BESIDE * BESIDE)
    return torch.where(near, torch.cat([action[:, :3], softened], 1), action)


def _thrust(action: Tensor) -> Tensor:
    """m/s^2 of a thrust in [-1, 1]."""
    return THRUST_MIN + (action.clamp(-1.0, 1.0) + 1.0) * _HALF
