"""A widened actor computes what it did, and its copies are free to differ."""

from dataclasses import replace

import pytest
import torch

from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.widen import widened
from policies.task.observation import OBS_DIM

SMALL = NetworkConfig(channels=(4, 6, 8), width=16)


@pytest.mark.parametrize(
    "wanted",
    [
        replace(SMALL, channels=(8, 12, 16), width=32),
        replace(SMALL, channels=(12, 6, 16), width=16),
        replace(SMALL, width=48),
        replace(SMALL, regimes=True),
        replace(SMALL, width=32, regimes=True),
    ],
)
def test_a_wider_network_computes_the_same(wanted):
    torch.manual_seed(1)
    actor, observation = Actor(SMALL), torch.randn(64, OBS_DIM)
    torch.nn.init.normal_(actor.head.weight)
    wide = widened(actor, wanted)
    assert wide.config == wanted
    for before, after in zip(actor.with_foresight(observation), wide.with_foresight(observation), strict=True):
        torch.testing.assert_close(after, before, atol=1e-5, rtol=1e-5)


def test_a_network_may_begin_to_ask_about_the_mirror_image():
    torch.manual_seed(1)
    actor, observation = Actor(SMALL), torch.randn(8, OBS_DIM)
    both = widened(actor, replace(SMALL, mirrored=True))
    image = actor(observation * both.observation_signs) * both.action_signs
    torch.testing.assert_close(both(observation), 0.5 * (actor(observation) + image))


def test_a_network_may_begin_to_touch_aligned_and_lean_otherwise():
    leaning = widened(Actor(SMALL), replace(SMALL, aligned=True, lean=0.1))
    more = widened(leaning, replace(SMALL, aligned=True, lean=0.2, lean_unsure=0.05, soft=0.5, width=32))
    assert leaning.lean.tolist() == pytest.approx([0.1]) and more.lean.tolist() == pytest.approx([0.2])
    assert more.lean_unsure.tolist() == pytest.approx([0.05]) and more.soft.tolist() == [0.5]
    assert not {"lean", "lean_unsure", "soft"} & widened(more, replace(SMALL, width=32)).state_dict().keys()


def test_regimes_are_not_thrown_away():
    with pytest.raises(ValueError, match="regimes"):
        widened(Actor(replace(SMALL, regimes=True)), SMALL)


def test_copies_of_a_unit_learn_different_things():
    torch.manual_seed(1)
    wide = widened(Actor(SMALL), replace(SMALL, width=32))
    wide(torch.randn(64, OBS_DIM)).square().sum().backward()
    gradient = wide.trunk.second.weight.grad
    assert gradient is not None
    assert not torch.allclose(gradient[:16], gradient[16:])


@pytest.mark.parametrize(
    "wanted", [replace(SMALL, width=24), replace(SMALL, width=8), replace(SMALL, geometry=False, width=32)]
)
def test_what_is_no_multiple_is_refused(wanted):
    with pytest.raises(ValueError, match="whole multiples"):
        widened(Actor(SMALL), wanted)
