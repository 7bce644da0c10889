"""Advantages by hand."""

import pytest
import torch

from policies.training.learners.rollout import Rollout


def test_advantages_agree_with_hand_calculation():
    r = Rollout(3, 1, torch.device("cpu"))
    r.reward[:, 0], r.value[:, 0] = torch.tensor([1.0, 2.0, 3.0]), torch.tensor([0.5, 1.0, 1.5])
    r.done[:, 0] = torch.tensor([0.0, 1.0, 0.0])
    advantage, returns = r.advantages(torch.tensor([4.0]), gamma=0.9, gae=0.8)
    d2 = 3.0 + 0.9 * 4.0 - 1.5
    d1 = 2.0 - 1.0  # the episode ends: nothing from beyond
    d0 = 1.0 + 0.9 * 1.0 - 0.5
    assert advantage[:, 0].tolist() == pytest.approx([d0 + 0.72 * d1, d1, d2], rel=1e-6)
    assert returns[:, 0].tolist() == pytest.approx((advantage[:, 0] + r.value[:, 0]).tolist())
