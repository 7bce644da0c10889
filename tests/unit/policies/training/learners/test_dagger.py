"""Imitation: it learns, it resumes to the same curve, it stops on numbers that are not finite."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from policies.environment.config import EnvConfig
from policies.network.actor_critic import NetworkConfig
from policies.task.observation import NEWEST, OBS_DIM
from policies.training.learners.dagger import Dagger, DaggerConfig, Replay
from policies.training.learners.storage import TrainingError

torch.set_num_threads(1)
ENV = EnvConfig(count=64, seed=21, odometry_noise=0.0, future_stride=10)
SMALL = DaggerConfig(samples=64 * 8 * 12, horizon=8, replay=4096, batch=256, batches=4, teacher_fade=2000)


def make(config=SMALL, **network):
    return Dagger(ENV, NetworkConfig(**network), config)


@pytest.mark.parametrize("mirrored", [False, True])
def test_learns_to_imitate(mirrored):
    config = DaggerConfig(samples=64 * 8 * 40, horizon=8, batch=512, batches=8, teacher_fade=100_000)
    run = make(config, mirrored=mirrored)
    losses = []
    while not run.finished:
        losses.append(run.step()["loss"])
    assert np.mean(losses[-4:]) < 0.6 * np.mean(losses[:4])


@pytest.mark.parametrize("mirrored", [False, True])
def test_resume_gives_the_same_curve(mirrored):
    whole, half = make(mirrored=mirrored), make(mirrored=mirrored)
    curve = [whole.step() for _ in range(6)]
    for _ in range(3):
        half.step()
    state = half.state()
    rest = make(mirrored=mirrored)
    rest.step()  # a run that has already drawn other numbers
    rest.load(state)
    for expected in curve[3:]:
        got = rest.step()
        assert got["loss"] == expected["loss"] and got["samples"] == expected["samples"]
    for a, b in zip(whole.actor.parameters(), rest.actor.parameters(), strict=True):
        assert torch.equal(a, b)


def test_over_steep_boards_it_keeps_what_it_did():
    run = make(replace(SMALL, keep=30.0))
    for _ in range(3):
        run.step()
    observation = torch.from_numpy(run.replay.observation[: run.replay.filled].astype(np.float32))
    with torch.no_grad():
        before, now = run.before(observation).numpy(), run.actor(observation).numpy()
    off = np.abs(run.replay.label[: run.replay.filled] - before).max(1)
    upright = observation[:, NEWEST + 5].numpy()
    steep, flat = upright < math.cos(math.radians(30.5)), upright > math.cos(math.radians(29.5))
    assert steep.sum() > 400 and flat.sum() > 400
    assert off[steep].max() < 0.02  # the replay's observations are rounded to half precision
    assert np.median(off[flat]) > 0.1 and np.abs(now - before).max() > 0.1


def test_replay_keeps_the_newest():
    replay = Replay(6)
    for k in range(4):
        replay.add(np.full((2, OBS_DIM), k), np.full((2, 4), k), np.full(2, k), np.full((2, 8), k))
    assert replay.filled == 6
    assert sorted(replay.label[:, 0].tolist()) == [1, 1, 2, 2, 3, 3]


def test_numbers_that_are_not_finite_stop_the_run():
    run = make()
    run.step()
    with torch.no_grad():
        run.actor.head.bias[0] = float("nan")
    with pytest.raises((TrainingError, ValueError), match="not finite"):
        run.step()


def test_a_planner_that_knows_something_else_is_refused():
    with pytest.raises(ValueError, match="'belief' or empty"):
        DaggerConfig(planner="truth")


@pytest.mark.parametrize("keep", [-1.0, 91.0, float("nan")])
def test_an_inclination_that_no_board_has_is_refused(keep):
    with pytest.raises(ValueError, match="from 0 to 90 deg"):
        DaggerConfig(keep=keep)
