"""Where policy search looks: the last layer of an actor, in the directions in which the features before it vary most.

Each direction is scaled so that the features vary by one along it near the board: a change of one sigma in any of them
changes the action about as much as in any other. What the features never do is not searched: nothing would be learnt
of it.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn


class HeadSpace(nn.Module):
    """The directions in which an actor's last layer is searched, and how far along each it has come (in sigmas)."""

    weight: Tensor
    bias: Tensor
    mean: Tensor
    basis: Tensor

    def __init__(self, head: nn.Linear, directions: int, sigma: float) -> None:
        super().__init__()
        self.sigma = sigma
        outputs, width = head.weight.shape
        directions = min(directions, width)
        self.register_buffer("weight", head.weight.detach().clone())
        self.register_buffer("bias", head.bias.detach().clone())
        self.register_buffer("mean", torch.zeros(width))
        self.register_buffer("basis", torch.zeros(width, directions))
        self.offset = nn.Parameter(torch.zeros(outputs, directions + 1))  # the last column is the bias

    def span(self, features: Tensor) -> None:
        """Take the directions of largest variance of `features` (B, width)."""
        self.mean.copy_(features.mean(0))
        values, vectors = torch.linalg.eigh(torch.cov(features.T.double()))
        count = self.basis.shape[1]
        scale = values[-count:].clamp(min=1e-12).sqrt()
        self.basis.copy_((vectors[:, -count:] / scale).flip(1))

    def changed(self, features: Tensor, change: Tensor) -> Tensor:
        """What each row's own `change` (B, outputs, directions + 1), in sigmas, adds to its output (B, outputs)."""
        along = torch.cat([(features - self.mean) @ self.basis, torch.ones_like(features[:, :1])], 1)
        return self.sigma * torch.bmm(change, along[:, :, None])[:, :, 0]

    @torch.no_grad()
    def write(self, head: nn.Linear) -> None:
        """Put the layer where `offset` has come to into `head`."""
        step = self.sigma * self.offset
        head.weight.copy_(self.weight + step[:, :-1] @ self.basis.T)
        head.bias.copy_(self.bias + step[:, -1] - step[:, :-1] @ (self.basis.T @ self.mean))
