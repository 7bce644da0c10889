"""The network that teaches the last metres: what it is told, where it teaches, and what it refuses."""

import math
from pathlib import Path

import numpy as np
import pytest

from policies.contract import ContractError
from policies.env import Env
from policies.env_config import EnvConfig
from policies.env_finisher import Finisher, true_observations
from policies.env_planner import PlannerTeacher
from policies.observation import ENTRY_DIM, NEWEST, OBS_DIM

CHECKPOINTS = Path(__file__).parents[3] / "policies" / "checkpoints"
STATE = CHECKPOINTS / "state.onnx"


def flown(stage, steps, **changes):
    env = Env(EnvConfig(stage=stage, count=16, stride=3, seed=5, odometry_noise=0.0, **changes))
    env.reset()
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(0.1 * rng.standard_normal((16, 4)))
    return env


@pytest.mark.parametrize("steps", [0, 1, 40, 130])
def test_it_is_told_what_the_state_stage_shows(steps):
    env, told = flown("state", steps), np.zeros((16, OBS_DIM), dtype=np.float32)
    true_observations(env.rows, 3, np.zeros((16, ENTRY_DIM)), told)
    assert np.allclose(told, env.rows.observation, atol=1e-5)


def test_it_teaches_near_flat_boards_and_leaves_the_rest_to_the_first_teacher():
    env = flown("vision", 60, speed=(0.5, 1.0), inclination_deg=(0.0, 60.0))
    alone, together = PlannerTeacher(env), Finisher(env, PlannerTeacher(env), STATE, 3.0, math.radians(30.0))
    told = np.zeros((16, OBS_DIM), dtype=np.float32)
    true_observations(env.rows, 3, np.zeros((16, ENTRY_DIM)), told)
    near = np.linalg.norm(told[:, NEWEST : NEWEST + 3], axis=1) < 3.0
    taught = near & (told[:, NEWEST + 5] > math.cos(math.radians(30.0)))
    assert taught.any()
    assert not taught.all()
    changed = (np.abs(alone.act() - together.act()) > 1e-6).any(axis=1)
    assert np.array_equal(changed, taught)
    assert np.isinf(together.remaining[taught]).all()


def test_a_policy_of_the_vision_stage_is_refused():
    env = flown("vision", 0)
    with pytest.raises(ContractError, match="state stage"):
        Finisher(env, PlannerTeacher(env), CHECKPOINTS / "vision.onnx", 2.0, 0.3)
