"""The averaged weights of a learner: what is exported, and what the next phase begins with."""

from __future__ import annotations

import torch

from policies.network.actor_critic import Actor


@torch.no_grad()
def average_in(average: Actor, trained: Actor, decay: float, updates: int) -> None:
    """Move the averaged weights towards the trained ones, in place, after so many `updates` before this one.

    An exponential average whose decay is lower at first, so that a short training forgets the weights that it began
    with: until (1 + updates) / (10 + updates) exceeds `decay`, the average spans about the last ninth of the updates.
    """
    kept = min(decay, (1.0 + updates) / (10.0 + updates))
    for mine, theirs in zip(average.parameters(), trained.parameters(), strict=True):
        mine.lerp_(theirs, 1.0 - kept)
