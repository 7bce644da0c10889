"""Networks: shapes, ablations, the geometry features against plain vector arithmetic."""

import math

import numpy as np
import pytest
import torch

from policies.network.actor_critic import FUTURE, GEOMETRY_DIM, Actor, Critic, NetworkConfig, geometry, normalisation
from policies.task import entry_row, tail_row
from policies.task.observation import NEWEST, OBS_DIM, TAIL

torch.set_num_threads(1)


def observations(count=5, seed=0):
    return torch.from_numpy(np.random.default_rng(seed).normal(size=(count, OBS_DIM)).astype(np.float32))


@pytest.mark.parametrize("temporal", [True, False])
@pytest.mark.parametrize("with_geometry", [True, False])
def test_network_shapes_and_log_probability_are_right_for_every_ablation(temporal, with_geometry):
    config = NetworkConfig(temporal=temporal, geometry=with_geometry)
    actor, critic = Actor(config), Critic(config)
    observation, future = observations(), torch.zeros(5, FUTURE * entry_row.DIM)
    assert actor(observation).shape == (5, 4)
    assert critic(observation, future).shape == (5,)
    density = -4.0 * (config.log_std + 0.5 * math.log(2 * math.pi))
    assert actor.log_prob(torch.zeros(5, 4), torch.zeros(5, 4)).detach().numpy() == pytest.approx(density, rel=1e-5)
    assert NetworkConfig.of(config.data()) == config


def test_the_reflected_observation_gets_the_reflected_action():
    actor = Actor(NetworkConfig())
    torch.nn.init.normal_(actor.head.weight)
    seen, reflected = actor(observations()), actor(observations() * actor.observation_signs)
    assert torch.allclose(reflected, seen * actor.action_signs, atol=1e-5)


def test_actor_ignores_the_past_without_temporal_augmentation():
    for temporal in (True, False):
        actor = Actor(NetworkConfig(temporal=temporal))
        torch.nn.init.normal_(actor.head.weight)
        one = observations()
        two = one.clone()
        two[:, :NEWEST] += 1.0
        changed = bool((actor(one) - actor(two)).abs().max() > 1e-4)
        assert changed == temporal


def test_critic_ignores_the_future_without_temporal_augmentation():
    for temporal in (True, False):
        critic = Critic(NetworkConfig(temporal=temporal))
        far = torch.ones(5, FUTURE * entry_row.DIM)
        changed = bool((critic(observations(), 0 * far) - critic(observations(), far)).abs().max() > 1e-5)
        assert changed == temporal


def test_network_geometry_agrees_with_hand_calculation():
    newest, tail = torch.zeros(1, entry_row.DIM), torch.zeros(1, tail_row.DIM)
    newest[0, :9] = torch.tensor([1.0, 2.0, -2.0, 0.6, 0.0, 0.8, 1.5, 0.5, 0.1])
    tail[0, 0:3] = torch.tensor([0.5, 0.5, -1.0])
    tail[0, tail_row.R : tail_row.R + 9] = torch.eye(3).ravel()
    out = geometry(newest, tail)[0].numpy()
    assert out.shape == (GEOMETRY_DIM,)
    p, n, v = np.array([1.0, 2.0, -2.0]), np.array([0.6, 0.0, 0.8]), np.array([-1.0, 0.0, -1.0])
    along, closing = p @ n, v @ n
    assert out[0] == pytest.approx(along) and out[1] == pytest.approx(closing)
    assert out[2:5] == pytest.approx(p - along * n, abs=1e-5) and out[5:8] == pytest.approx(v - closing * n, abs=1e-5)
    assert out[8:11] == pytest.approx(2.0 * (np.array([0, 0, 1]) - n), abs=1e-6)
    assert out[11:14] == pytest.approx(v)
    assert out[16] == pytest.approx(1.0 / 3.25)


def test_normalisation_covers_the_observation():
    shift, scale = normalisation()
    assert len(shift) == len(scale) == entry_row.DIM + tail_row.DIM
    assert min(scale) > 0.0
    actor = Actor(NetworkConfig())
    assert actor.trunk.scale.shape == (OBS_DIM,)
    assert actor.trunk.scale[TAIL - 1] == actor.trunk.scale[entry_row.DIM - 1]
