"""The layer from afar: it comes nearer to its teacher, it alone moves, it resumes, and refuses other networks."""

from dataclasses import replace

import pytest
import torch

from policies.environment.config import EnvConfig
from policies.flying.shipped import policy_file
from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.regimes import AFAR
from policies.training.actor import load_actor
from policies.training.learners.layer_fit import LayerFit, LayerFitConfig
from policies.training.learners.storage import TrainingError

torch.set_num_threads(1)
ENV = EnvConfig(
    stage="vision", count=24, seed=41, stride=8, future_stride=10, warm=0.5,
    speed=(1.5, 2.2), inclination_deg=(66.0, 74.0), noise_scale=(0.1, 0.1), laws=(1.0, 0.0, 0.0, 0.0),
)  # fmt: skip
SHORT = LayerFitConfig(horizon=120)
MINE = slice(4 * AFAR, 4 * AFAR + 4)


def fresh(config=SHORT, env=ENV) -> LayerFit:
    path = policy_file("vision")
    assert path is not None
    actor = load_actor(path)[0]
    return LayerFit(env, actor.config, config, actor=actor)


def test_one_layer_moves_towards_the_planner():
    run = fresh()
    before = {name: value.clone() for name, value in run.actor.state_dict().items()}
    with torch.no_grad():
        run.actor.head.weight[MINE] = 0.0
        run.actor.head.bias[MINE] = 0.0
    empty = run.state()["actor"]["head.bias"].clone()
    first = run.step()
    after = run.actor.state_dict()
    kept = torch.ones(len(empty), dtype=torch.bool)
    kept[MINE] = False
    assert all(torch.equal(after[name], before[name]) for name in before if not name.startswith("head."))
    assert torch.equal(after["head.weight"][kept], before["head.weight"][kept])
    mean_square = float(run.moments[:, -1, -1].sum() / (4.0 * run.moments[3, -2, -2]))  # of what was taught
    assert 0.0 < first["error"] < 0.7 * mean_square**0.5
    assert float(after["head.weight"][MINE].abs().max()) > 0.0


def test_resume_gives_the_same_curve():
    whole, half, rest = fresh(), fresh(), fresh()
    curve = [whole.step() for _ in range(3)]
    half.step()
    rest.step()
    rest.step()  # a run that has already drawn other numbers
    rest.load(half.state())
    assert [rest.step()["error"] for _ in range(2)] == [numbers["error"] for numbers in curve[1:]]
    assert torch.equal(whole.actor.head.weight, rest.actor.head.weight)


def test_boards_that_take_no_run_up_are_flown_as_before():
    run = fresh(env=replace(ENV, inclination_deg=(61.0, 61.0), speed=(0.6, 0.8)))
    head = run.actor.head.weight.detach().clone()
    assert run.step()["error"] < 0.05
    assert not torch.equal(head[MINE], run.actor.head.weight[MINE])


def test_without_a_board_to_learn_from_it_stops_and_keeps_the_layer():
    run = fresh(env=replace(ENV, inclination_deg=(0.0, 20.0)))
    head = run.actor.head.weight.detach().clone()
    with pytest.raises(TrainingError, match="steep, steady board"):
        run.step()
    assert torch.equal(head, run.actor.head.weight)


@pytest.mark.parametrize("network", [{"regimes": True}, {"mirrored": True}])
def test_a_network_without_such_a_layer_is_refused(network):
    config = NetworkConfig(**network)
    with pytest.raises(TrainingError, match="regimes, mirrored"):
        LayerFit(ENV, config, SHORT, actor=Actor(config))


@pytest.mark.parametrize(("name", "value"), [("forget", 1.5), ("horizon", 2)])
def test_settings_out_of_range_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        LayerFitConfig(**{name: value})
