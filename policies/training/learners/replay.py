"""The replay buffer of imitation: the newest samples, on the learner's device, in half precision."""

from __future__ import annotations

import torch
from torch import Tensor

from policies.network.actor_critic import FORESEEN
from policies.task.observation import OBS_DIM

_SIZES = {"observation": OBS_DIM, "label": 4, "weight": 1, "foreseen": 2 * len(FORESEEN)}


class Replay:
    """The newest `size` samples of observation, label, weight, and future board positions."""

    def __init__(self, size: int, device: torch.device) -> None:
        self._parts = {k: torch.zeros(size, n, dtype=torch.float16, device=device) for k, n in _SIZES.items()}
        self.size, self.filled, self._head, self._device = size, 0, 0, device

    def add(self, observation: Tensor, label: Tensor, weight: Tensor, foreseen: Tensor) -> None:
        """Keep samples, (B, n) each, `weight` (B,)."""
        count = len(label)
        at = (self._head + torch.arange(count, device=self._device)) % self.size
        given = {"observation": observation, "label": label, "weight": weight[:, None], "foreseen": foreseen}
        for name, part in self._parts.items():
            part[at] = given[name].to(part.dtype)
        self._head, self.filled = (self._head + count) % self.size, min(self.size, self.filled + count)

    def draw(self, at: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """The samples of those indices below `filled`, in single precision, in the order of `add`."""
        observation, label, weight, foreseen = (part[at].float() for part in self._parts.values())
        return observation, label, weight[:, 0], foreseen

    def state(self) -> dict:
        """For a checkpoint."""
        return {"head": self._head, "filled": self.filled, **{k: v[: self.filled] for k, v in self._parts.items()}}

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        self._head, self.filled = state["head"], state["filled"]
        for name, part in self._parts.items():
            part[: self.filled] = state[name].to(self._device)
