"""Several processes, one gradient: what torchrun needs. Without it every function here does nothing."""

from __future__ import annotations

import os
from collections.abc import Iterable

import torch
import torch.distributed as dist

from policies.training.learners.storage import TrainingError


def start(device: str) -> tuple[int, int, str]:
    """Join the process group if torchrun started us. Returns (rank, processes, device of this process).

    Raises TrainingError if the device is not there.
    """
    world = int(os.environ.get("WORLD_SIZE", "1"))
    _check(device)
    if world == 1:
        return 0, 1, device
    if device == "cuda":
        device = f"cuda:{os.environ.get('LOCAL_RANK', '0')}"
        torch.cuda.set_device(device)
    if not dist.is_initialized():
        dist.init_process_group("cpu:gloo,cuda:nccl" if device.startswith("cuda") else "gloo")
    return dist.get_rank(), world, device


def _check(device: str) -> None:
    kind, colon, index = device.partition(":")
    if kind not in ("cpu", "cuda") or (colon and not (kind == "cuda" and index.isdecimal())):
        raise TrainingError(f"there is no device '{device}'; give cpu, cuda or cuda:N")
    if kind == "cuda":
        count = torch.cuda.device_count() if torch.cuda.is_available() else 0
        if int(index or 0) >= count:
            seen = f"torch sees {count} CUDA GPU{'s' * (count > 1)} here" if count else "torch sees no CUDA GPU here"
            raise TrainingError(f"device '{device}' was asked for, but {seen}; use --device cpu")


def active() -> bool:
    """True in a process group."""
    return dist.is_available() and dist.is_initialized()


def share_weights(module: torch.nn.Module) -> None:
    """Give every process the weights of the first."""
    if active():
        for value in module.state_dict().values():
            dist.broadcast(value, 0)


def average_gradients(parameters: Iterable[torch.nn.Parameter]) -> None:
    """Replace each gradient by its mean over the processes."""
    if active():
        for parameter in parameters:
            if parameter.grad is not None:
                dist.all_reduce(parameter.grad)
                parameter.grad /= dist.get_world_size()


def mean(value: float) -> float:
    """Mean of a number over the processes; NaN counts as absent only if it is so everywhere."""
    if not active():
        return value
    pair = torch.tensor([0.0 if value != value else value, 0.0 if value != value else 1.0], dtype=torch.float64)
    dist.all_reduce(pair)
    return float(pair[0] / pair[1]) if pair[1] > 0 else float("nan")


def summed(value: torch.Tensor) -> torch.Tensor:
    """Sum of a tensor over the processes."""
    if active():
        dist.all_reduce(value)
    return value
