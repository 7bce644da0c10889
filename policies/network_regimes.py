"""Last layers in place of one: for flat boards, for slopes and for steep ones seen poorly, and for both seen well.

What is right in the last half second differs: over a flat board at speed the drone glides and must hold the board in
its picture; a slope whose surface is uncertain is met faster than one that is known to a millimetre, and a steep one
asks for a flare. From afar all is seen poorly: steep boards are approached by their own of the two. The shares are
functions of what the network is told, the same in training and in flight.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from policies.network_touch import seen_poorly

REGIMES = 4
# Cosines of the inclination where a share is nothing, and where all.
_SLOPE = math.cos(math.radians(15.0)), math.cos(math.radians(25.0))
_STEEP = math.cos(math.radians(45.0)), math.cos(math.radians(60.0))


def regime_shares(newest: Tensor, tail: Tensor) -> Tensor:
    """(B, REGIMES) how much each counts, one in all, from history entry `newest` (B, 10) and `tail` (B, 20)."""
    slope, steep = (_ramp(newest[:, 5:6], *between) for between in (_SLOPE, _STEEP))
    poorly = slope * seen_poorly(tail)
    return torch.cat([1.0 - slope, poorly * (1.0 - steep), poorly * steep, slope - poorly], 1)


def _ramp(x: Tensor, none: float, full: float) -> Tensor:
    """0 at `none` and beyond, 1 at `full` and beyond."""
    return ((x - none) / (full - none)).clamp(0.0, 1.0)
