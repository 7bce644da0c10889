"""Left and right: observations, the vehicle and a symmetric actor know no difference."""

import numpy as np
import pytest
import torch

from kernel.rotations import from_euler
from policies.network.actor_critic import Actor, NetworkConfig
from policies.task.observation import OBS_DIM, build_observation, command_from_action, history_dim, push_history
from policies.task.symmetry import ACTION_SIGNS, OBSERVATION_SIGNS
from vehicle.quadrotor import dynamics as d
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import load_airframe
from vehicle.quadrotor.rate_control import fly

torch.set_num_threads(1)
STRIDE = 3
VECTOR = np.array([1.0, -1.0, 1.0])
TURN = np.array([1.0, -1.0, 1.0, -1.0])  # of a quaternion
BOARD = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0])  # y, heading and turn rate change sign


def observed(signs, seed):
    """What is seen of random boards from a random attitude; `signs` of (vector, quaternion, board, action)."""
    vector, turn, board, action = signs
    rng, row, out = np.random.default_rng(seed), np.zeros(history_dim(STRIDE)), np.zeros(OBS_DIM, np.float32)
    for k in range(100):
        push_history(board * rng.normal(0.0, 1.0, 8), 0.01 * k, row)
    q = turn * np.array(from_euler(*rng.uniform(-1.2, 1.2, 3)))
    p, v, before = rng.normal(0.0, 3.0, 3), rng.normal(0.0, 2.0, 3), rng.uniform(-1.0, 1.0, 4)
    build_observation(row, vector * p, vector * v, q, 0.7, action * before, 1.1, 0.3, 0.01, STRIDE, 0.99, out)
    return out


@pytest.mark.parametrize("seed", range(5))
def test_observation_of_a_reflected_scene_has_the_reflection_signs(seed):
    ones = (np.ones(3), np.ones(4), np.ones(8), np.ones(4))
    seen = observed(ones, seed)
    image = observed((VECTOR, TURN, BOARD, np.array(ACTION_SIGNS)), seed)
    np.testing.assert_allclose(image, seen * np.array(OBSERVATION_SIGNS, np.float32), atol=1e-5)
    assert np.abs(image - seen).max() > 0.1


def test_vehicle_flies_the_reflected_path_under_reflected_actions():
    rng, airframe = np.random.default_rng(2), load_airframe("paper_quad")
    params, limits = airframe.params_row(), airframe.limits_row()
    row, command = d.vehicle_row((0.0, 0.0, 2.0), motor=0.4), np.zeros(4)
    image = row.copy()
    for _ in range(60):
        action = rng.uniform(-0.2, 0.3, 4)
        for each, signs in ((row, np.ones(4)), (image, np.array(ACTION_SIGNS))):
            command_from_action(signs * action, limits, command)
            fly(each, command, params, 0.01, 5)
    np.testing.assert_allclose(
        image[state_row.P : state_row.P + 3], VECTOR * row[state_row.P : state_row.P + 3], atol=1e-9
    )
    np.testing.assert_allclose(
        image[state_row.V : state_row.V + 3], VECTOR * row[state_row.V : state_row.V + 3], atol=1e-9
    )
    np.testing.assert_allclose(
        image[state_row.Q : state_row.Q + 4], TURN * row[state_row.Q : state_row.Q + 4], atol=1e-9
    )
    assert abs(row[state_row.P + 1]) > 0.01


def test_symmetric_actor_answers_a_reflected_observation_with_the_reflected_action():
    def broken(symmetric):
        torch.manual_seed(3)
        actor, observation = Actor(NetworkConfig(symmetric=symmetric)), torch.randn(32, OBS_DIM)
        torch.nn.init.normal_(actor.head.weight, std=0.2)
        image = actor(observation * torch.tensor(OBSERVATION_SIGNS))
        return (image - torch.tensor(ACTION_SIGNS) * actor(observation)).abs().max().item()

    assert broken(symmetric=True) < 1e-5
    assert broken(symmetric=False) > 1e-2
