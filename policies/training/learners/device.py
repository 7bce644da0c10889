"""The device of learning: the check of its name, and the copy of the environment's rows to it."""

from __future__ import annotations

import torch
from torch import Tensor

from policies.environment.env import Env
from policies.training.learners.storage import TrainingError


def open_device(name: str) -> torch.device:
    """The device `cpu`, `cuda` or `cuda:N`. Raises TrainingError in one line if it is not there."""
    kind, colon, index = name.partition(":")
    if kind not in ("cpu", "cuda") or (colon and not (kind == "cuda" and index.isdecimal())):
        raise TrainingError(f"there is no device '{name}'; give cpu, cuda or cuda:N")
    if kind == "cuda":
        count = torch.cuda.device_count() if torch.cuda.is_available() else 0
        if int(index or 0) >= count:
            seen = f"torch sees {count} CUDA GPU{'s' * (count > 1)} here" if count else "torch sees no CUDA GPU here"
            raise TrainingError(f"device '{name}' was asked for, but {seen}; use --device cpu")
        torch.set_num_threads(1)  # the processor's cores belong to the environment
    return torch.device(name)


class Uplink:
    """What a learner reads of an environment each step, copied to its device.

    For a GPU the environment writes into page-locked memory, so that no copy blocks. A copy has ended once an action
    that depends on it has come back; only then may the environment step.
    """

    def __init__(self, env: Env, device: torch.device) -> None:
        """To be made before the environment's reset: it replaces two of its arrays."""
        if device.type == "cuda":
            sizes = {name: getattr(env.rows, name).shape for name in ("observation", "future")}
            locked = {name: torch.zeros(size, pin_memory=True).numpy() for name, size in sizes.items()}
            env.rows = env.rows._replace(**locked)
        self._device = device
        self._observation, self._future = (torch.from_numpy(a) for a in (env.rows.observation, env.rows.future))

    def observation(self) -> Tensor:
        """(N, OBS_DIM) float32. On the CPU it is the environment's own memory, which the next step overwrites."""
        return self._observation.to(self._device, non_blocking=True)

    def future(self) -> Tensor:
        """(N, FUTURE_DIM) float32, as `observation`."""
        return self._future.to(self._device, non_blocking=True)
