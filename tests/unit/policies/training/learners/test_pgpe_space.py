"""The directions that policy search looks along."""

import torch

from policies.training.learners.pgpe_space import HeadSpace


def test_directions_are_scaled_and_a_change_is_what_the_layer_written_does():
    torch.manual_seed(1)
    head = torch.nn.Linear(12, 4)
    features = torch.randn(500, 12) * torch.linspace(0.1, 3.0, 12) + 2.0
    space = HeadSpace(head, 5, 0.01)
    space.span(features)
    along = (features - space.mean) @ space.basis
    assert torch.allclose(torch.cov(along.T), torch.eye(5), atol=1e-3)
    change = torch.randn(4, 6)
    before = head(features).detach()
    wanted = before + space.changed(features, change.expand(500, 4, 6))
    with torch.no_grad():
        space.offset.copy_(change)
    space.write(head)
    assert torch.allclose(head(features), wanted, atol=1e-5)
    assert not torch.allclose(wanted, before, atol=1e-3)
