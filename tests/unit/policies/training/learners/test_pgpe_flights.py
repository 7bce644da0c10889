"""Flights to where they are decided, and from there, as often as is wanted, to their ends."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from groundcar.motion import board_row
from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.environment.rows import E_STEPS, S_STEP
from policies.flying.shipped import policy_file
from policies.task.observation import NEWEST
from policies.training.actor import load_actor
from policies.training.learners.pgpe_flights import copy_rows, fly_near, fly_out, rather_turning
from vehicle.quadrotor import state_row

torch.set_num_threads(1)
ENV = EnvConfig(count=48, seed=31, odometry_noise=0.0, future_stride=10, speed=(1.0, 2.0), inclination_deg=(0.0, 50.0))


def act_of(actor):
    def act(observation, _which):
        with torch.no_grad():
            return actor(torch.from_numpy(observation)).numpy()

    return act


def sinking(observation, _which):
    """A law for each row by itself: a matrix product's last bit depends on how many rows there are."""
    still, ahead = np.zeros(len(observation)), observation[:, NEWEST]
    return np.stack([still, 0.02 * ahead, still, still - 0.1], 1)


def test_flights_from_one_moment():
    path = policy_file("state")
    assert path is not None
    env = Env(replace(ENV, stage="vision"))
    start, steps = fly_near(env, act_of(load_actor(path)[0]), 1.0)
    assert 0 < len(start.done) <= ENV.count and steps > 0
    step = start.state[:, S_STEP].astype(int)
    away = np.linalg.norm(
        start.track[np.arange(len(step)), step, :3] - start.vehicle[:, state_row.P : state_row.P + 3], axis=1
    )
    assert (away < 1.0).all() and away.max() > 0.9
    before = [array.copy() for array in start]
    ended, _ = fly_out(start, env.shared, sinking, [5])
    thrice, _ = fly_out(start, env.shared, sinking, [5, 5, 6])
    first, second, other = thrice.reshape(3, len(start.done), -1)
    assert np.array_equal(ended, first) and np.array_equal(first, second)
    assert not np.array_equal(first, other)
    assert (ended[:, E_STEPS] > 0).all()
    assert all(np.array_equal(a, b) for a, b in zip(before, start, strict=True))


def test_an_action_that_is_not_finite_stops_the_flight():
    env = Env(ENV)
    with pytest.raises(ValueError, match="not finite"):
        fly_near(env, lambda observation, _: np.full((len(observation), 4), np.nan), 1.0)


def test_of_boards_that_turn_all_stay_of_others_few():
    env = Env(replace(ENV, count=4))
    env.reset()
    rows = copy_rows(env.rows, np.tile(np.arange(4), 500))
    turn = np.repeat([0.0, -0.325, 0.55, -1.2], 500)
    rows.track[:, :, board_row.TURN_RATE] = turn[:, None]
    kept = rather_turning(rows, 0.55, np.random.default_rng(3))
    counts = [(kept.track[:, 0, board_row.TURN_RATE] == t).sum() for t in (0.0, -0.325, 0.55, -1.2)]
    assert counts[2:] == [500, 500]
    assert counts[0] == pytest.approx(0.12 * 500, abs=25) and counts[1] == pytest.approx(0.5 * 500, abs=40)


def test_if_no_board_turns_flights_are_left():
    env = Env(replace(ENV, count=1))
    env.reset()
    env.rows.track[:, :, board_row.TURN_RATE] = 0.0
    assert all(len(rather_turning(env.rows, 0.55, np.random.default_rng(k)).done) == 1 for k in range(20))
