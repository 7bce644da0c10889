"""Imitation of a teacher on the states that the student itself visits (Ross, Gordon, Bagnell 2011).

The student averages over what it cannot observe, so labels must depend on the present state alone. An iteration:
`horizon` steps in all rows, a share of them flown by the teacher (roll-in), then `batches` of Adam from the replay.
Replay and networks are on the device; the environment is not. Random numbers, rows, optimiser and replay are all in the
checkpoint, so that a resumed run continues the same curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor
from torch.nn.functional import smooth_l1_loss

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.network.actor_critic import FORESEEN, Actor, NetworkConfig
from policies.task import entry_row
from policies.task.observation import NEWEST
from policies.training.learners.averaging import average_in
from policies.training.learners.device import Uplink
from policies.training.learners.learner import take_episodes
from policies.training.learners.replay import Replay
from policies.training.learners.storage import TrainingError, env_state, load_env
from policies.training.learners.teachers import open_teacher

_FORESEEN = [k * entry_row.DIM + axis for k in FORESEEN for axis in (0, 1)]  # predicted columns of the future
_NEAR = 0.4  # m from the board within which samples count more


@dataclass(frozen=True)
class DaggerConfig:
    """`samples` environment steps in all; `replay` of them kept.

    `teacher`: its actions are the labels, see `teachers.open_teacher`. The share of rows flown by the teacher falls
    from 1 to `teacher_floor` over `teacher_fade` samples. `noise`: one-sigma added to the student's actions while
    collecting. `near`: extra weight of a sample close to the board. `foresee`: weight of the auxiliary loss that makes
    the trunk predict the board's future positions. `huber`: where the loss becomes linear. `average`: decay of the
    averaged weights, which are exported, see `average_in`."""

    samples: int = 8_000_000
    teacher: str = "expert"
    horizon: int = 32
    replay: int = 600_000
    batch: int = 4096
    batches: int = 12
    rate: float = 1e-3
    rate_end: float = 2e-5
    teacher_fade: int = 1_000_000
    teacher_floor: float = 0.1
    noise: float = 0.05
    near: float = 3.0
    foresee: float = 0.1
    huber: float = 0.1
    average: float = 0.995


class Dagger:
    """The learner of imitation, see `learner.Learner`."""

    name: ClassVar[str] = "dagger"

    def __init__(
        self,
        env: EnvConfig,
        network: NetworkConfig,
        config: DaggerConfig,
        device: torch.device,
        actor: Actor | None = None,
    ) -> None:
        """`actor`: the initial actor; None: new weights. Raises TrainingError for a teacher that does not fit."""
        self.config, self.device = config, device
        torch.manual_seed(env.seed)
        self.actor = (actor or Actor(network)).to(device)
        self.average = Actor(network).to(device)
        self.average.load_state_dict(self.actor.state_dict())
        self.optimiser = torch.optim.Adam(self.actor.parameters(), lr=config.rate)
        self.rng = torch.Generator().manual_seed(env.seed)  # the host's: the same numbers on every device
        self.env = Env(env)
        self._uplink = Uplink(self.env, device)
        self.env.reset()
        self.teacher = open_teacher(config.teacher, self.env, device)
        self.replay = Replay(min(config.replay, config.samples), device)
        self.samples = 0

    @property
    def finished(self) -> bool:
        return self.samples >= self.config.samples

    def step(self) -> dict[str, float]:
        c = self.config
        share = max(c.teacher_floor, 1.0 - self.samples / max(1, c.teacher_fade))
        self._collect(share)
        progress = min(1.0, self.samples / c.samples)
        rate = c.rate_end + 0.5 * (c.rate - c.rate_end) * (1.0 + math.cos(math.pi * progress))
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        loss = self._learn()
        _, numbers = take_episodes(self.env)
        return {"samples": self.samples, **numbers, "loss": loss, "teacher": share, "rate": rate}

    def _collect(self, share: float) -> None:
        env, c = self.env, self.config
        count = env.config.count
        by_teacher = (torch.rand(count, 1, generator=self.rng) < share).to(self.device)
        for _ in range(c.horizon):
            observation, future = self._uplink.observation(), self._uplink.future()
            label, usable = self.teacher.act(observation)
            noise = (c.noise * torch.randn(count, 4, generator=self.rng)).to(self.device)
            with torch.no_grad():
                flown = torch.where(by_teacher, label, self.actor(observation) + noise)
                distance = observation[:, NEWEST : NEWEST + 3].norm(dim=1)
                weight = usable * (1.0 + c.near * torch.exp(-distance / _NEAR))
            self.replay.add(observation, label, weight, future[:, _FORESEEN])
            env.step(flown.cpu().numpy())
            self.samples += count

    def _learn(self) -> float:
        """`batches` steps of Adam; the mean loss. Raises TrainingError if it is not finite."""
        c = self.config
        chosen = torch.randint(self.replay.filled, (c.batches, c.batch), generator=self.rng).to(self.device)
        reflected = (torch.rand(c.batches, c.batch, 1, generator=self.rng) < 0.5).to(self.device)
        losses = [self._descend(at, which) for at, which in zip(chosen, reflected, strict=True)]
        loss = float(torch.stack(losses).mean())
        if not math.isfinite(loss):
            raise TrainingError("the imitation loss is not finite; the last good checkpoint is kept")
        return loss

    def _descend(self, at: Tensor, reflected: Tensor) -> Tensor:
        c, actor = self.config, self.actor
        observation, label, weight, foreseen = self.replay.draw(at)
        if actor.config.symmetric:  # half of the samples reflected: the trunk is used on either side
            observation = torch.where(reflected, observation * actor.observation_signs, observation)
            label = torch.where(reflected, label * actor.action_signs, label)
            foreseen = torch.where(reflected, foreseen * actor.future_signs, foreseen)
        mean, predicted = actor.with_foresight(observation)
        error = smooth_l1_loss(mean, label, beta=c.huber, reduction="none").sum(1)
        loss = (error * weight).mean() + c.foresee * smooth_l1_loss(predicted, foreseen, beta=0.1)
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(actor.parameters(), 1.0)
        self.optimiser.step()
        average_in(self.average, actor, c.average, self.samples // (self.env.config.count * c.horizon) * c.batches)
        return loss.detach()

    def state(self) -> dict:
        return {
            "actor": self.actor.state_dict(),
            "average": self.average.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "rng": self.rng.get_state(),
            "env": env_state(self.env),
            "teacher": self.teacher.state(),
            "replay": self.replay.state(),
            "samples": self.samples,
        }

    def load(self, state: dict) -> None:
        for name in ("actor", "average", "optimiser"):
            getattr(self, name).load_state_dict(state[name])
        self.rng.set_state(state["rng"])
        load_env(self.env, state["env"])
        self.teacher.load(state["teacher"])
        self.replay.load(state["replay"])
        self.samples = state["samples"]
