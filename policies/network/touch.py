"""`touch_attitude.touch_rates`, then `late_flare.late_flare`, in torch: part of an `aligned` network and its file."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from policies.guidance.alignment import (
    BAND,
    BANK,
    BANK_FROM,
    BANK_MOST,
    BESIDE,
    FACING,
    FROM,
    LAG,
    MOST,
    SHORTEST,
    SLOWEST,
    UNSURE,
)
from policies.guidance.flare import ASIDE, CLOSING, LATEST, SHORTEST_TURN, WITHIN
from policies.task import tail_row
from policies.task.observation import RATE_MAX, THRUST_MAX
from vehicle.quadrotor.airframe import GRAVITY

WELL, POORLY = 0.002, 0.006  # m, sigma of the board's surface: where it is well seen, and where poorly
BELOW, RADIUS = 0.04, 0.13  # m, the underside's disc as in the airframe paper_quad
SLOPE = 0.5  # sine of the inclination
_TINY = 1e-9  # under the root: its slope stays finite


class Approach(NamedTuple):
    """`touch.approach` of the body's centre, and what it takes; one column each, but for the first three (B, 3)."""

    normal: Tensor
    axis: Tensor  # body z
    velocity: Tensor  # relative to the board
    height: Tensor
    beside: Tensor  # squared
    closing: Tensor
    cosine: Tensor


def seen_poorly(tail: Tensor) -> Tensor:
    """(B, 1) from 0 for a surface that is seen well to 1 for one that is seen poorly; `tail` (B, 20)."""
    return ((tail[:, tail_row.SIGMA : tail_row.SIGMA + 1] - WELL) / (POORLY - WELL)).clamp(0.0, 1.0)


def lean_everywhere(newest: Tensor) -> Tensor:
    """(B, 1): a lean up a vertical slope times this is as much up all slopes from SLOPE on, and less below."""
    return 1.0 / (1.0 - newest[:, 5:6] ** 2).clamp(min=SLOPE * SLOPE).sqrt()


def relative_velocity(newest: Tensor, tail: Tensor) -> Tensor:
    """(B, 3) m/s, the drone's less the board's, which has none upwards."""
    v = tail[:, tail_row.V : tail_row.V + 3]
    return torch.cat([v[:, :2] - newest[:, 6:8], v[:, 2:]], 1)


def approach(newest: Tensor, tail: Tensor) -> Approach:
    d, n = -newest[:, 0:3], newest[:, 3:6]
    velocity = relative_velocity(newest, tail)
    z = tail[:, [tail_row.R + 2, tail_row.R + 5, tail_row.R + 8]]
    height = (d * n).sum(1, keepdim=True)
    beside = (d * d).sum(1, keepdim=True) - height * height
    closing = -(velocity * n).sum(1, keepdim=True)
    return Approach(n, z, velocity, height, beside, closing, (n * z).sum(1, keepdim=True))


def _wanted_axis(newest: Tensor, left: Tensor, lean: Tensor) -> Tensor:
    """`touch_attitude.wanted_axis`. The slope is the normal's horizontal part turned up."""
    n, (vx, vy), rate = newest[:, 3:6], newest[:, 6:8].split(1, 1), newest[:, 8:9]
    nx, ny, nz = n.split(1, 1)
    level = torch.zeros_like(nx)
    up = torch.cat([-nx * nz, -ny * nz, nx * nx + ny * ny], 1)
    pull = torch.cat([-vy, vx, level], 1) * (rate / GRAVITY)
    size = (pull * pull).sum(1, keepdim=True).clamp(min=_TINY).sqrt()
    bank = (BANK * (size - BANK_FROM)).clamp(min=0.0, max=BANK_MOST)
    return n + rate * left * torch.cat([-ny, nx, level], 1) + lean * up + bank / size * pull


def _in_body(off: Tensor, tail: Tensor) -> Tensor:
    """Components (B, 2) along the body's x and y axes, the first two columns of R."""
    return torch.stack(
        [(off * tail[:, [tail_row.R + k, tail_row.R + 3 + k, tail_row.R + 6 + k]]).sum(1) for k in range(2)], 1
    )


def aligned_action(newest: Tensor, tail: Tensor, action: Tensor, lean: Tensor) -> Tensor:
    """`touch_rates` on what a network sees.

    `newest` (B, 10) history entry and `tail` (B, 20), both in the yaw frame; `action` (B, 4), clipped to [-1, 1] where
    it is corrected; `lean` (1,) or (B, 1) rad up a vertical slope.
    """
    _, z, _, height, beside, closing, cosine = approach(newest, tail)
    edge = BELOW * cosine + RADIUS * (1.0 - cosine * cosine).clamp(min=_TINY).sqrt()
    margin = (UNSURE * tail[:, tail_row.SIGMA : tail_row.SIGMA + 1]).clamp(max=MOST)
    left = (height - edge - margin) / closing.clamp(min=SLOWEST)
    near = (closing >= SLOWEST) & (cosine >= FACING) & (beside <= BESIDE * BESIDE) & (left <= FROM)
    left = left.clamp(min=0.0, max=FROM)
    wanted = _wanted_axis(newest, left, lean)
    off = _in_body(torch.linalg.cross(z, wanted), tail)
    span = (left - LAG).clamp(min=SHORTEST)
    asked = action.clamp(-1.0, 1.0)
    then = off - RATE_MAX * (tail[:, tail_row.ACTION : tail_row.ACTION + 2] * LAG + asked[:, :2] * span)
    excess = then - then.clamp(-BAND, BAND)
    rates = (asked[:, :2] + excess / (span * RATE_MAX)).clamp(-1.0, 1.0)
    return torch.where(near, torch.cat([rates, asked[:, 2:]], 1), action)


def flared_action(newest: Tensor, tail: Tensor, action: Tensor, lean: Tensor) -> Tensor:
    """`late_flare` on what a network sees; arguments as of `aligned_action`."""
    n, z, _, height, beside, closing, cosine = approach(newest, tail)
    height = height - BELOW - RADIUS * lean * (n[:, 0:1] * n[:, 0:1] + n[:, 1:2] * n[:, 1:2]).clamp(min=_TINY).sqrt()
    strongest = THRUST_MAX * tail[:, tail_row.GAIN : tail_row.GAIN + 1]
    stopping = closing * closing - 2.0 * height * (0.5 * strongest * (1.0 + cosine) - GRAVITY * n[:, 2:3])
    left = 2.0 * height / (closing + stopping.clamp(min=_TINY).sqrt()).clamp(min=CLOSING)
    near = (height > 0.0) & (closing >= CLOSING) & (cosine >= 0.0) & (beside <= ASIDE * ASIDE) & (stopping > 0.0)
    left = left.clamp(min=0.0, max=WITHIN + 1.0)
    wanted = _wanted_axis(newest, left, lean)
    off = torch.linalg.cross(z, wanted)
    sine = (off * off).sum(1, keepdim=True).clamp(min=_TINY).sqrt()
    off = _in_body(off * torch.atan2(sine, (z * wanted).sum(1, keepdim=True)) / sine, tail)
    span = (left - LAG).clamp(min=SHORTEST_TURN)
    needed = (off - RATE_MAX * tail[:, tail_row.ACTION : tail_row.ACTION + 2] * LAG) / span
    late = near & (left <= WITHIN) & ((needed * needed).sum(1, keepdim=True) > LATEST * LATEST)
    rates = (needed / RATE_MAX).clamp(-1.0, 1.0)
    return torch.where(late, torch.cat([rates, action[:, 2:]], 1), action)
