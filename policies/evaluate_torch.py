"""An actor still in training as a policy for the evaluation."""

from __future__ import annotations

import numpy as np
import torch

from policies.env import Env
from policies.network import Actor


class TorchPolicy:
    """An actor's mean action, clipped, as an `evaluate.Policy`."""

    def __init__(self, actor: Actor, device: str = "cpu") -> None:
        self._actor, self._device = actor.to(device).eval(), device

    def __call__(self, env: Env) -> np.ndarray:
        with torch.no_grad():
            return self._actor(torch.from_numpy(env.rows.observation).to(self._device)).clamp(-1, 1).cpu().numpy()
