"""Imitation: it learns, it resumes to the same curve, it stops on numbers that are not finite."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from policies.environment.config import EnvConfig
from policies.network.actor_critic import NetworkConfig
from policies.training.learners.dagger import Dagger, DaggerConfig
from policies.training.learners.storage import TrainingError

torch.set_num_threads(1)
ENV = EnvConfig(count=64, seed=21, odometry_noise=0.0, future_stride=10)
SMALL = DaggerConfig(samples=64 * 8 * 12, horizon=8, replay=4096, batch=256, batches=4, teacher_fade=2000)
CPU = torch.device("cpu")


def make(config=SMALL, env=ENV, **network):
    return Dagger(env, NetworkConfig(channels=(24, 32, 48), width=128, **network), config, CPU)


@pytest.mark.parametrize("symmetric", [False, True])
def test_dagger_learns_to_imitate_its_teacher(symmetric):
    config = DaggerConfig(samples=64 * 8 * 40, horizon=8, batch=512, batches=8, teacher_fade=100_000)
    run = make(config, symmetric=symmetric)
    losses = []
    while not run.finished:
        losses.append(run.step()["loss"])
    assert np.mean(losses[-4:]) < 0.6 * np.mean(losses[:4])


def test_the_average_of_a_short_training_has_forgotten_the_random_weights():
    run = make(replace(SMALL, average=0.998))  # 48 updates: a decay of 0.998 alone keeps 91 % of the first weights
    first = torch.cat([p.detach().flatten().clone() for p in run.actor.parameters()])
    while not run.finished:
        run.step()
    last, average = (torch.cat([p.detach().flatten() for p in a.parameters()]) for a in (run.actor, run.average))
    assert (average - last).norm() < 0.4 * (first - last).norm()


@pytest.mark.parametrize("teacher", ["expert", "vision"])
def test_resumed_dagger_has_the_same_curve(teacher):
    config, env = replace(SMALL, teacher=teacher), replace(ENV, stride=8 if teacher == "vision" else 3)
    whole, half = make(config, env), make(config, env)
    curve = [whole.step() for _ in range(6)]
    for _ in range(3):
        half.step()
    state = half.state()
    rest = make(config, env)
    rest.step()  # a run that has already drawn other numbers
    rest.load(state)
    for expected in curve[3:]:
        got = rest.step()
        assert got["loss"] == expected["loss"] and got["samples"] == expected["samples"]
    for a, b in zip(whole.actor.parameters(), rest.actor.parameters(), strict=True):
        assert torch.equal(a, b)


def test_non_finite_values_stop_dagger():
    run = make()
    run.step()
    with torch.no_grad():
        run.actor.head.bias[0] = float("nan")
    with pytest.raises((TrainingError, ValueError), match="not finite"):
        run.step()
