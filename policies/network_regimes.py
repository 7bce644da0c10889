"""Three last layers in place of one: for flat boards, for steep ones seen poorly, and for steep ones seen well.

What is right in the last half second differs: over a flat board at speed the drone glides and must hold the board in
its picture; a slope whose surface is uncertain is met faster than one that is known to a millimetre. The shares are
functions of what the network is told, the same in training and in flight.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from policies.network_touch import seen_poorly

REGIMES = 3
_FLAT, _STEEP = math.cos(math.radians(15.0)), math.cos(math.radians(25.0))  # of the inclination: all, nothing of flat


def regime_shares(newest: Tensor, tail: Tensor) -> Tensor:
    """(B, REGIMES) how much each counts, one in all, from history entry `newest` (B, 10) and `tail` (B, 20)."""
    flat = ((newest[:, 5:6] - _STEEP) / (_FLAT - _STEEP)).clamp(0.0, 1.0)
    poorly, steep = seen_poorly(tail), 1.0 - flat
    return torch.cat([flat, steep * poorly, steep * (1.0 - poorly)], 1)
