"""PPO: improvement on a task that can be seen to improve, resume, the pull to the clone, the noise floor."""

from dataclasses import replace

import numpy as np
import torch

from policies.environment import episode_row
from policies.environment.config import EnvConfig
from policies.network.actor_critic import NetworkConfig
from policies.task.reward import RewardWeights
from policies.training.learners.ppo import Ppo, PpoConfig

torch.set_num_threads(1)
ENV = EnvConfig(count=64, seed=31, odometry_noise=0.0, future_stride=10, horizon=160)
SMALL = PpoConfig(samples=64 * 8 * 20, horizon=8, minibatch=256, epochs=2)


NETWORK = NetworkConfig(channels=(24, 32, 48), width=128, symmetric=False)
CPU = torch.device("cpu")


def make(config=SMALL, env=ENV):
    return Ppo(env, NETWORK, config, CPU)


def test_ppo_raises_a_reward_of_action_size_only():
    """With nothing but the action-size bonus, the policy learns to ask for little thrust change and small rates."""
    weights = RewardWeights(
        guide=0.0, action=40.0, smoothness=0.0, aggressiveness=0.0, time=0.0, failure=0.0, success=0.0
    )
    config = PpoConfig(samples=64 * 16 * 40, horizon=16, minibatch=512, epochs=4, rate=1e-3, std=0.5, gamma=0.9)
    run = make(config, replace(ENV, weights=weights))
    with torch.no_grad():
        run.actor.head.bias.fill_(0.8)
    rewards = [run.step()["reward"] for _ in range(26)]
    assert rewards[-1] > rewards[0] * 1.15


def test_the_average_of_a_short_training_has_left_its_start():
    run = make()  # 20 iterations: a decay of 0.98 alone keeps 67 % of the first weights, with which a phase begins
    first = torch.cat([p.detach().flatten().clone() for p in run.actor.parameters()])
    while not run.finished:
        run.step()
    last, average = (torch.cat([p.detach().flatten() for p in a.parameters()]) for a in (run.actor, run.average))
    assert (average - last).norm() < 0.5 * (first - last).norm()


def test_resumed_ppo_has_the_same_curve():
    whole, half = make(), make()
    curve = [whole.step() for _ in range(5)]
    for _ in range(2):
        half.step()
    state = half.state()
    rest = make()
    rest.step()
    rest.load(state)
    for expected in curve[2:]:
        assert rest.step()["reward"] == expected["reward"]
    for a, b in zip(whole.actor.parameters(), rest.actor.parameters(), strict=True):
        assert torch.equal(a, b)


def test_penalty_towards_the_cloned_actor_limits_its_change():
    moved = []
    for clone in (0.0, 100.0):
        run = make(replace(SMALL, clone=clone, rate=1e-3, std=0.1))
        for _ in range(4):
            run.step()
        observation = run.rollout.observation.flatten(0, 1)
        moved.append(float((run.actor(observation) - run.start(observation)).detach().abs().mean()))
    assert moved[1] < 0.3 * moved[0]


def test_actor_is_unchanged_while_only_the_critic_learns():
    run = make(replace(SMALL, critic_only=10_000_000))
    run.step()
    for a, b in zip(run.actor.trunk.parameters(), run.start.trunk.parameters(), strict=True):
        assert torch.equal(a, b)


def test_action_noise_stays_above_its_floor():
    run = make(replace(SMALL, std=0.1, std_floor=0.1, rate=1e-2))
    for _ in range(3):
        run.step()
    assert float(run.actor.log_std.exp().min().detach()) >= 0.0999


def test_episodes_have_different_ages_from_the_first_rollout_on():
    run = make()
    run.step()
    rows = run.env.rows.state
    ages = rows[:, episode_row.STEP] - rows[:, episode_row.BEGIN]
    assert np.ptp(ages) > 50 and len(np.unique(ages)) > 16
