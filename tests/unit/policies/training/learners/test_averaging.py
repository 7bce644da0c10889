"""Averaged weights: an exponential average in the long run, no memory of the first weights in a short one."""

import pytest
import torch

from policies.network.actor_critic import Actor, NetworkConfig
from policies.training.learners.averaging import average_in

NETWORK = NetworkConfig(channels=(8, 8, 8), width=8)


def filled(value):
    actor = Actor(NETWORK)
    with torch.no_grad():
        for parameter in actor.parameters():
            parameter.fill_(value)
    return actor


@pytest.mark.parametrize(("updates", "kept"), [(0, 0.1), (8, 0.5), (10_000, 0.98)])
def test_decay_is_lower_at_first(updates, kept):
    average = filled(1.0)
    average_in(average, filled(0.0), 0.98, updates)
    assert all(torch.allclose(p, torch.full_like(p, kept)) for p in average.parameters())


@pytest.mark.parametrize("count", [3, 30, 3000])
def test_first_weights_are_forgotten_after_any_number_of_updates(count):
    average = filled(1.0)
    for updates in range(count):
        average_in(average, filled(0.0), 0.998, updates)
    assert float(average.head.bias.detach().max()) < 0.01
