"""The replay: the newest samples, in the order in which they came, and again after a resume."""

import torch

from policies.task.observation import OBS_DIM
from policies.training.learners.replay import Replay

CPU = torch.device("cpu")


def filled(size, adds):
    replay = Replay(size, CPU)
    for k in range(adds):
        replay.add(torch.full((2, OBS_DIM), k), torch.full((2, 4), k), torch.full((2,), k), torch.full((2, 8), k))
    return replay


def test_replay_keeps_the_newest_samples():
    replay = filled(6, 4)
    assert replay.filled == 6
    assert sorted(replay.draw(torch.arange(6))[1][:, 0].tolist()) == [1, 1, 2, 2, 3, 3]


def test_replay_resumes_from_its_checkpoint():
    replay, again = filled(6, 2), Replay(6, CPU)
    again.load(replay.state())
    for each in (replay, again):
        each.add(torch.ones(2, OBS_DIM), torch.ones(2, 4), torch.ones(2), torch.ones(2, 8))
    for mine, theirs in zip(replay.draw(torch.arange(6)), again.draw(torch.arange(6)), strict=True):
        assert torch.equal(mine, theirs)
