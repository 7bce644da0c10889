"""`touch_attitude.touch_rates` in torch: part of an `aligned` network, and so of the file that it is exported to."""

from __future__ import annotations

import torch
from torch import Tensor

from policies.observation import RATE_MAX, TAIL_ACTION, TAIL_R, TAIL_V
from policies.touch_attitude import BAND, BESIDE, FACING, FROM, LAG, SHORTEST, SLOWEST

BELOW, RADIUS = 0.04, 0.13  # m, the underside's disc as in the airframe paper_quad
_TINY = 1e-9  # under the root: its slope stays finite


def aligned_action(newest: Tensor, tail: Tensor, action: Tensor, lean: Tensor) -> Tensor:
    """`touch_rates` on what a network sees.

    `newest` (B, 10) history entry and `tail` (B, 18), both in the yaw frame; `action` (B, 4), clipped to [-1, 1] where
    it is corrected; `lean` (1,) rad up a vertical slope.
    """
    d, n = -newest[:, 0:3], newest[:, 3:6]
    ground = torch.zeros_like(newest[:, :1])
    board_v = torch.cat([newest[:, 6:8], ground], 1)
    z = tail[:, [TAIL_R + 2, TAIL_R + 5, TAIL_R + 8]]
    height = (d * n).sum(1, keepdim=True)
    beside = (d * d).sum(1, keepdim=True) - height * height
    closing = -((tail[:, TAIL_V : TAIL_V + 3] - board_v) * n).sum(1, keepdim=True)
    cosine = (n * z).sum(1, keepdim=True)
    edge = BELOW * cosine + RADIUS * (1.0 - cosine * cosine).clamp(min=_TINY).sqrt()
    left = (height - edge) / closing.clamp(min=SLOWEST)
    near = (closing >= SLOWEST) & (cosine >= FACING) & (beside <= BESIDE * BESIDE) & (left <= FROM)
    left = left.clamp(min=0.0, max=FROM)
    turn = newest[:, 8:9] * left
    # The slope is the normal's horizontal part turned up: n = (-sin i, cos i) and u = (cos i, sin i) along the heading.
    nx, ny, nz = n[:, 0:1], n[:, 1:2], n[:, 2:3]
    up = torch.cat([-nx * nz, -ny * nz, nx * nx + ny * ny], 1)
    wanted = n + turn * torch.cat([-ny, nx, ground], 1) + lean * up
    off = torch.linalg.cross(z, wanted)
    # Body x and y axes are the first two columns of R.
    off = torch.stack([(off * tail[:, [TAIL_R + k, TAIL_R + 3 + k, TAIL_R + 6 + k]]).sum(1) for k in range(2)], 1)
    span = (left - LAG).clamp(min=SHORTEST)
    asked = action.clamp(-1.0, 1.0)
    then = off - RATE_MAX * (tail[:, TAIL_ACTION : TAIL_ACTION + 2] * LAG + asked[:, :2] * span)
    excess = then - then.clamp(-BAND, BAND)
    rates = (asked[:, :2] + excess / (span * RATE_MAX)).clamp(-1.0, 1.0)
    return torch.where(near, torch.cat([rates, asked[:, 2:]], 1), action)
