"""Contenders by name, each in the environment that it was made for."""

import numpy as np
import pytest

from policies.evaluation.contenders import open_contender
from policies.evaluation.evaluate import run_episodes
from policies.flying.contract import ContractError
from policies.flying.onnx_file import open_policy
from policies.task import result_row
from policies.task.contact import SUCCESS

STATE = "policies/checkpoints/state.onnx"
FLAT = {"speed": (0.8, 1.2), "inclination_deg": (0.0, 20.0), "families": (1.0, 0, 0, 0, 0, 0)}


def test_unknown_name_is_refused_in_one_line_with_the_nearest_name():
    with pytest.raises(ValueError, match="did you mean 'planner'") as error:
        open_contender("plannr")
    assert "\n" not in str(error.value)
    with pytest.raises(ContractError, match="does not exist"):
        open_contender("nowhere.onnx")


def test_network_is_evaluated_in_the_environment_of_its_contract():
    network = open_contender(STATE)
    config = network.config(None, 5, count=8)
    assert (config.stage, config.seed, config.noise_scale) == ("state", 5, (1.0, 1.0))
    assert config.stride == open_policy(STATE).contract.observation.stride
    assert config.odometry_noise == 0.0 and network.config("vision", 5).odometry_noise == 1.0


@pytest.mark.parametrize(
    ("name", "stage", "least"),
    [("planner", "vision", 0.6), ("planner-analytic", "state", 0.7), ("expert", "state", 0.9)],
)
def test_contender_perches_on_an_easy_board_and_repeats_exactly(name, stage, least):
    contender = open_contender(name)
    ended = run_episodes(contender.policy, contender.config(stage, 40, count=32, **FLAT), noise="measured")
    assert (ended[:, result_row.OUTCOME] == SUCCESS).mean() >= least
    again = run_episodes(contender.policy, contender.config(stage, 40, count=32, **FLAT), noise="measured")
    assert np.array_equal(ended, again)
