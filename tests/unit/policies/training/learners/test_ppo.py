"""PPO: advantages by hand, improvement on a task that can be seen to improve, curriculum, resume."""

import numpy as np
import pytest
import torch

from policies.environment.config import EnvConfig
from policies.network.actor_critic import NetworkConfig
from policies.task.reward import RewardWeights
from policies.training.learners.ppo import Ppo, PpoConfig, Rollout

torch.set_num_threads(1)
ENV = EnvConfig(count=64, seed=31, odometry_noise=0.0, future_stride=10, horizon=160)
SMALL = PpoConfig(samples=64 * 8 * 20, horizon=8, minibatch=256, epochs=2)


def test_advantages_by_hand():
    r = Rollout(3, 1)
    r.reward[:, 0], r.value[:, 0], r.done[:, 0] = [1.0, 2.0, 3.0], [0.5, 1.0, 1.5], [0.0, 1.0, 0.0]
    advantage, returns = r.advantages(np.array([4.0], dtype=np.float32), gamma=0.9, gae=0.8)
    d2 = 3.0 + 0.9 * 4.0 - 1.5
    d1 = 2.0 - 1.0  # the episode ends: nothing from beyond
    d0 = 1.0 + 0.9 * 1.0 - 0.5
    assert advantage[:, 0] == pytest.approx([d0 + 0.72 * d1, d1, d2], rel=1e-6)
    assert returns[:, 0] == pytest.approx(advantage[:, 0] + r.value[:, 0])


def test_pays_off_what_is_paid():
    """With nothing but the action-size bonus, the policy learns to ask for little thrust change and small rates."""
    weights = RewardWeights(
        guide=0.0, action=40.0, smoothness=0.0, aggressiveness=0.0, time=0.0, failure=0.0, success=0.0
    )
    from dataclasses import replace

    config = PpoConfig(samples=64 * 16 * 40, horizon=16, minibatch=512, epochs=4, rate=1e-3, std=0.5, gamma=0.9)
    run = Ppo(replace(ENV, weights=weights), NetworkConfig(), config)
    with torch.no_grad():
        run.actor.head.bias.fill_(0.8)
    first = run.step()["reward"]
    for _ in range(25):
        last = run.step()["reward"]
    assert last > first * 1.15


def test_resume_gives_the_same_curve():
    whole, half = Ppo(ENV, NetworkConfig(), SMALL), Ppo(ENV, NetworkConfig(), SMALL)
    curve = [whole.step() for _ in range(5)]
    for _ in range(2):
        half.step()
    state = half.state()
    rest = Ppo(ENV, NetworkConfig(), SMALL)
    rest.step()
    rest.load(state)
    for expected in curve[2:]:
        assert rest.step()["reward"] == expected["reward"]
    for a, b in zip(whole.actor.parameters(), rest.actor.parameters(), strict=True):
        assert torch.equal(a, b)


def test_reverse_curriculum_lets_the_teacher_fly_first():
    from dataclasses import replace

    run = Ppo(ENV, NetworkConfig(), replace(SMALL, reverse=True, lead=0.2, std=0.05))
    shares = []
    for _ in range(40):
        run.step()
        shares.append(run.rollout.own.mean())
    assert shares[0] == 0.0
    assert 0.0 < np.mean(shares[20:]) < 0.5


def test_noise_keeps_its_floor():
    from dataclasses import replace

    run = Ppo(ENV, NetworkConfig(), replace(SMALL, std=0.1, std_floor=0.1, rate=1e-2))
    for _ in range(3):
        run.step()
    assert float(run.actor.log_std.exp().min().detach()) >= 0.0999
