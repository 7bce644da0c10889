"""Where learning runs: a device that is not there is refused in one line."""

import pytest
import torch

from policies.training.learners.device import open_device
from policies.training.learners.storage import TrainingError


@pytest.mark.parametrize(("device", "count"), [("cuda", 0), ("cuda:0", 0), ("cuda:2", 2)])
def test_absent_gpu_is_refused(monkeypatch, device, count):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: count > 0)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: count)
    with pytest.raises(TrainingError, match=f"'{device}' was asked for.*(no CUDA GPU|2 CUDA GPUs) here"):
        open_device(device)


@pytest.mark.parametrize("device", ["gpu", "cpu:0", "cuda:x"])
def test_unknown_device_name_is_refused(device):
    with pytest.raises(TrainingError, match=f"no device '{device}'"):
        open_device(device)
