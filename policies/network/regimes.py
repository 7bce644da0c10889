"""Last layers in place of one, for flat boards, slopes and steep ones, by how well they are seen.

What is right in the last half second differs: over a flat board at speed the drone glides and must hold the board in
its picture; a slope whose surface is uncertain is met faster than one that is known to a millimetre, and a steep one
asks for a flare. From afar all is seen poorly: steep boards are approached by their own of the two, and touched by
another where the detector is poor and not the distance long. One whose speed has been steady is approached by a layer
of its own, in a hurry; where the speed swings, waiting for it to be slow pays. The shares are functions of what the
network is told, the same in training and in flight.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from policies.network.touch import seen_poorly
from policies.task import entry_row, tail_row
from policies.task.observation import HISTORY, NEWEST, TAIL

REGIMES = 6
AFAR = 5  # index of the layer for steep, steady boards from afar
# Cosines of the inclination where a share is nothing, and where all.
_SLOPE = math.cos(math.radians(15.0)), math.cos(math.radians(25.0))
_STEEP = math.cos(math.radians(45.0)), math.cos(math.radians(60.0))
_NEAR = 3.0, 2.0  # m from the board
_BLURRED = 0.006, 0.009  # m, sigma: from 2 m on ours is below that, the published noise's 8 to 20 mm
_AFAR = 2.0, 2.6  # m from the board
_LATELY = 20  # entries of the history: 1.6 s at a stride of 8. In the first second speeds are still being found out
_STEADY = 0.8, 0.5  # m/s, range of the board's speeds lately


def regime_shares(observation: Tensor) -> Tensor:
    """(B, REGIMES) how much each counts, one in all, from observations (B, OBS_DIM)."""
    newest, tail = observation[:, NEWEST:TAIL], observation[:, TAIL:]
    slope, steep = (_ramp(newest[:, 5:6], *between) for between in (_SLOPE, _STEEP))
    sigma = tail[:, tail_row.SIGMA : tail_row.SIGMA + 1]
    distance = (newest[:, 0:3] ** 2).sum(1, keepdim=True).sqrt()
    poorly = slope * seen_poorly(tail)
    steeply, blurred = poorly * steep, _ramp(distance, *_NEAR) * _ramp(sigma, *_BLURRED)
    nearby = torch.cat([1.0 - slope, poorly - steeply, steeply * (1.0 - blurred), slope - poorly, steeply * blurred], 1)
    afar = steep * _ramp(distance, *_AFAR) * _ramp(_speed_range(observation), *_STEADY)
    return torch.cat([nearby * (1.0 - afar), afar], 1)


def _speed_range(observation: Tensor) -> Tensor:
    """(B, 1) m/s, of the board's speeds lately."""
    lately = observation[:, :TAIL].reshape(-1, HISTORY, entry_row.DIM)[:, -_LATELY:, 6:8]
    speed = (lately**2).sum(2).sqrt()
    return speed.amax(1, keepdim=True) - speed.amin(1, keepdim=True)


def _ramp(x: Tensor, none: float, full: float) -> Tensor:
    """0 at `none` and beyond, 1 at `full` and beyond."""
    return ((x - none) / (full - none)).clamp(0.0, 1.0)
