"""The samples of one iteration of PPO, on the learner's device."""

from __future__ import annotations

import torch
from torch import Tensor

from policies.environment.rows import FUTURE_DIM
from policies.task.observation import OBS_DIM


class Rollout:
    """Samples of one iteration, (horizon, N, ...); `wanted`: actions of the actor that training began with."""

    def __init__(self, horizon: int, count: int, device: torch.device) -> None:
        def zeros(*size: int) -> Tensor:
            return torch.zeros(horizon, count, *size, device=device)

        self.observation, self.future, self.action, self.wanted = zeros(OBS_DIM), zeros(FUTURE_DIM), zeros(4), zeros(4)
        self.log_prob, self.value, self.reward, self.done = zeros(), zeros(), zeros(), zeros()

    def advantages(self, last_value: Tensor, gamma: float, gae: float) -> tuple[Tensor, Tensor]:
        """Generalised advantage estimates and returns, (horizon, N) each; no value follows the end of an episode."""
        advantage = torch.zeros_like(self.reward)
        ahead, next_value = torch.zeros_like(last_value), last_value
        for t in reversed(range(len(self.reward))):
            alive = 1.0 - self.done[t]
            delta = self.reward[t] + gamma * next_value * alive - self.value[t]
            ahead = delta + gamma * gae * alive * ahead
            advantage[t], next_value = ahead, self.value[t]
        return advantage, advantage + self.value
