"""Where learning runs: a device that is not there is refused in one line."""

import pytest
import torch

from policies.training.learners.device import open_device
from policies.training.learners.storage import TrainingError


@pytest.mark.parametrize(("device", "count"), [("cuda", 0), ("cuda:0", 0), ("cuda:2", 2)])
def test_a_gpu_that_is_not_there_is_refused(monkeypatch, device, count):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: count > 0)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: count)
    with pytest.raises(TrainingError, match=f"'{device}' was asked for.*(no CUDA GPU|2 CUDA GPUs) here"):
        open_device(device)


@pytest.mark.parametrize("device", ["gpu", "cpu:0", "cuda:x"])
def test_a_name_that_is_no_device_is_refused(device):
    with pytest.raises(TrainingError, match=f"no device '{device}'"):
        open_device(device)
