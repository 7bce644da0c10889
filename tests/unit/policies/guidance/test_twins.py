"""The kernels of guidance compute what networks with the laws inside compute in torch."""

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from groundcar.motion.pose import board_normal
from policies.guidance.guide import guide
from policies.guidance.params import GuidanceParams
from policies.network.soft import softened_action
from policies.network.touch import aligned_action, flared_action, lean_everywhere, seen_poorly
from policies.task.observation import (
    NEWEST,
    OBS_DIM,
    TAIL,
    action_from_command,
    build_observation,
    command_from_action,
    history_dim,
    push_history,
)
from tests.unit.policies.guidance.situation import situation
from vehicle.quadrotor.airframe import load_airframe

torch.set_num_threads(1)
LIMITS = load_airframe("paper_quad").limits_row()
PARAMS = GuidanceParams.of(load_airframe("paper_quad"), thrust_lag=0.03)  # the lag that the graphs carry


def in_torch(board, p, v, q, asked, previous, sigma, gain, drag):
    """The laws as an exported graph has them: (4,) action."""
    history, observation = np.zeros(history_dim(1)), np.zeros(OBS_DIM, dtype=np.float32)
    push_history(board, 0.0, history)
    build_observation(history, p, v, q, 1.0, previous, gain, drag, sigma, 1, 0.0, observation)
    seen = torch.from_numpy(observation).double()[None]
    newest, tail = seen[:, NEWEST:TAIL], seen[:, TAIL:]
    lean = PARAMS.lean + PARAMS.lean_uncertain * seen_poorly(tail) * lean_everywhere(newest)
    action = aligned_action(newest, tail, torch.tensor(asked)[None], lean)
    action = flared_action(newest, tail, action, lean)
    return softened_action(newest, tail, action, torch.tensor([PARAMS.impact_speed]))[0].clamp(-1.0, 1.0).numpy()


def in_kernel(board, p, v, q, asked, previous, sigma, gain, drag):
    command, before, out = np.zeros(4), np.zeros(4), np.zeros(4)
    command_from_action(asked, LIMITS, command)
    command_from_action(previous, LIMITS, before)
    guide(command, p, v, q, board, sigma, before, gain, drag, PARAMS.row())
    action_from_command(command, LIMITS, out)
    return out


@pytest.mark.parametrize("part", ["align", "flare", "impact"])
@given(data=st.data())
def test_kernel_equals_the_exported_graph(part, data):
    def draw(low, high):
        return data.draw(st.floats(low, high))

    late = part == "flare"
    here = situation(
        draw(0.0, 1.4), draw(-0.2, 1.6) if late else draw(-0.5, 0.5), draw(-0.5, 0.5),
        draw(-0.02, 0.6 if late else 0.2), closing=draw(0.0, 4.0 if late else 1.5), turn=draw(-1.2, 1.2),
        heading=draw(-3.0, 3.0), speed=draw(0.0, 3.0),
    )  # fmt: skip
    board, p, v, q = here
    if part == "impact":  # hardly sliding
        v = v + draw(-0.4, 0.4) * np.array([1.0, 0.0, 0.0]) + draw(0.0, 1.5) * np.array([0.0, 0.0, 1.0])
    actions = np.array(data.draw(st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8)))
    told = actions[:4], actions[4:], data.draw(st.sampled_from((0.0, 0.001, 0.003, 0.008, 0.05))), draw(0.7, 1.4)
    told = *told, draw(0.0, 0.6)
    got = in_torch(board, p, v, q, *told)
    # Rounding to float32 may decide whether a law acts: then the answers on both sides of its limit count.
    n, answers = np.array(board_normal(board)), []
    for e, f in itertools.product((-1e-5, 0.0, 1e-5), repeat=2):
        answers.append(in_kernel(board, p + e * n, v - f * n, q, *told))
    assert min(np.abs(got - each).max() for each in answers) < 2e-3
