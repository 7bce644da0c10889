"""Regimes: who flies by which, and that each one's layer is what flies there."""

import math

import pytest
import torch

from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.regimes import REGIMES, regime_shares
from policies.task import entry_row, tail_row
from policies.task.observation import HISTORY, NEWEST, OBS_DIM, TAIL


def seen(inclination_deg, sigma, distance=1.0, was=1.0):
    """An observation of a board at 2 m/s that half a second ago was at `was` times that."""
    observation = torch.zeros(1, OBS_DIM)
    history = observation[:, :TAIL].reshape(1, HISTORY, entry_row.DIM)
    history[:, :, 7] = 2.0
    history[:, -6, 7] = 2.0 * was
    angle = math.radians(inclination_deg)
    observation[0, NEWEST + 3 : NEWEST + 6] = torch.tensor([-math.sin(angle), 0.0, math.cos(angle)])
    observation[0, NEWEST] = distance
    observation[0, TAIL + tail_row.SIGMA] = sigma
    return observation


@pytest.mark.parametrize(
    ("inclination_deg", "sigma", "distance", "was", "shares"),
    [
        (0.0, 0.012, 1.0, 1.0, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        (10.0, 0.0005, 5.0, 1.0, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        (30.0, 0.012, 1.0, 1.0, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)),
        (30.0, 0.004, 5.0, 1.0, (0.0, 0.5, 0.0, 0.5, 0.0, 0.0)),
        (60.0, 0.012, 5.0, 0.5, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)),
        (60.0, 0.006, 1.0, 1.0, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)),
        (60.0, 0.0005, 1.0, 1.0, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0)),
        (70.0, 0.004, 1.0, 1.0, (0.0, 0.0, 0.5, 0.5, 0.0, 0.0)),
        (70.0, 0.012, 1.0, 1.0, (0.0, 0.0, 0.0, 0.0, 1.0, 0.0)),
        (70.0, 0.012, 2.5, 0.5, (0.0, 0.0, 0.5, 0.0, 0.5, 0.0)),
        (70.0, 0.0075, 1.0, 1.0, (0.0, 0.0, 0.5, 0.0, 0.5, 0.0)),
        (70.0, 0.012, 5.0, 1.0, (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
        (70.0, 0.0005, 2.3, 1.0, (0.0, 0.0, 0.0, 0.5, 0.0, 0.5)),
        (70.0, 0.012, 5.0, 0.675, (0.0, 0.0, 0.5, 0.0, 0.0, 0.5)),
    ],
)
def test_who_flies_by_which(inclination_deg, sigma, distance, was, shares):
    got = regime_shares(seen(inclination_deg, sigma, distance, was))[0]
    assert got.tolist() == pytest.approx(shares, abs=1e-5)


def test_shares_are_one_in_all_and_change_without_a_jump():
    angles = torch.linspace(0.0, 80.0, 321)
    for sigma in (0.0, 0.003, 0.02):
        rows = torch.cat([seen(float(angle), sigma) for angle in angles])
        shares = regime_shares(rows)
        assert torch.allclose(shares.sum(1), torch.ones(len(rows)))
        assert float(shares.diff(dim=0).abs().max()) < 0.04


@pytest.mark.parametrize("mirrored", [False, True])
def test_each_layer_flies_its_own_regime(mirrored):
    torch.manual_seed(1)
    actor = Actor(NetworkConfig(regimes=True, mirrored=mirrored))
    with torch.no_grad():
        actor.head.weight.zero_()
        actor.head.bias.copy_(torch.arange(4 * REGIMES) / 100.0)
    situations = [seen(0.0, 0.01), seen(30.0, 0.01), seen(60.0, 0.01, 5.0, 0.5), seen(60.0, 0.0), seen(60.0, 0.01)]
    situations.append(seen(60.0, 0.01, 5.0))
    for regime, situation in enumerate(situations):
        thrust = float(actor(situation)[0, 3].detach())  # the mirror image asks for the same
        assert thrust == pytest.approx((4 * regime + 3) / 100.0)
