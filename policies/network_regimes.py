"""Last layers in place of one, for flat boards, slopes and steep ones, by how well they are seen.

What is right in the last half second differs: over a flat board at speed the drone glides and must hold the board in
its picture; a slope whose surface is uncertain is met faster than one that is known to a millimetre, and a steep one
asks for a flare. From afar all is seen poorly: steep boards are approached by their own of the two, and touched by
another where the detector is poor and not the distance long. The shares are functions of what the network is told, the
same in training and in flight.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from policies.network_touch import seen_poorly
from policies.observation import TAIL_SIGMA

REGIMES = 5
# Cosines of the inclination where a share is nothing, and where all.
_SLOPE = math.cos(math.radians(15.0)), math.cos(math.radians(25.0))
_STEEP = math.cos(math.radians(45.0)), math.cos(math.radians(60.0))
_NEAR = 3.0, 2.0  # m from the board
# m, sigma of the surface: below 6 mm from 2 m on by our detector, 8 to 20 by the published noise.
_BLURRED = 0.006, 0.009


def regime_shares(newest: Tensor, tail: Tensor) -> Tensor:
    """(B, REGIMES) how much each counts, one in all, from history entry `newest` (B, 10) and `tail` (B, 20)."""
    slope, steep = (_ramp(newest[:, 5:6], *between) for between in (_SLOPE, _STEEP))
    sigma = tail[:, TAIL_SIGMA : TAIL_SIGMA + 1]
    distance = (newest[:, 0:3] ** 2).sum(1, keepdim=True).sqrt()
    poorly = slope * seen_poorly(tail)
    steeply, blurred = poorly * steep, _ramp(distance, *_NEAR) * _ramp(sigma, *_BLURRED)
    return torch.cat([1.0 - slope, poorly - steeply, steeply * (1.0 - blurred), slope - poorly, steeply * blurred], 1)


def _ramp(x: Tensor, none: float, full: float) -> Tensor:
    """0 at `none` and beyond, 1 at `full` and beyond."""
    return ((x - none) / (full - none)).clamp(0.0, 1.0)
