"""Numbers of the episodes that ended in an iteration."""

import math

import numpy as np

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.training.learners.learner import take_episodes


def test_episodes_are_counted_once_with_their_success_and_rho():
    env = Env(EnvConfig(stage="vision", count=64, seed=3, limit=30))
    env.reset()
    rows, numbers = take_episodes(env)
    assert len(rows) == numbers["episodes"] == 0 and math.isnan(numbers["success"]) and math.isnan(numbers["rho"])
    for _ in range(31):
        env.step(np.zeros((64, 4)))
    rows, numbers = take_episodes(env)
    assert len(rows) == numbers["episodes"] >= 64 and 0.0 <= numbers["success"] <= 1.0
    assert 0.0 < numbers["rho"] <= 1.0
    assert take_episodes(env)[1]["episodes"] == 0
